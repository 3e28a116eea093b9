//! A synthetic stand-in of the published uniaxial test: a dumb-bell of a stiffening material, pulled by finite elements
//! to a gauge stretch of 4, its force with noise, and the fits of the paper's Table 1.

use super::curve::Curve;
use super::curve_law::{CurveLaw, OgdenTerms};
use super::deformation::HomogeneousTest;
use super::dumbbell::{DumbbellError, DumbbellOptions, fit_dumbbell, gauge_stretches};
use super::fit_options::CurveFitOptions;
use super::result::{CurveFit, fit_curves};
use crate::fem::ForwardModel;
use crate::material::{ShearTerm, initial_shear_modulus_kpa};
use crate::mesh::MeshOptions;
use crate::specimen::Specimen;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

/// Gauge stretches at which fits end: the published 2, and 4 instead of 4.5, which the shoulders of the meshed
/// dumb-bell do not reach.
pub const GAUGE_STRETCHES: [f64; 2] = [2.0, 4.0];
/// What made the data: the initial response of the paper's neo-Hookean fit and the stiffening of its free two-term fit.
/// The paper's own two-term fits with a held neo-Hookean term do not stiffen within the data.
pub const TRUTH: [ShearTerm; 2] =
    [ShearTerm { modulus_kpa: 9.45e-7 * 12.7, alpha: 12.7 }, ShearTerm { modulus_kpa: 33.2, alpha: 2.0 }];
/// κ of the truth over its initial shear modulus.
const BULK_RATIO: f64 = 130.0;
/// Forces recorded.
const NUM_POINTS: usize = 48;
/// The recorder's largest displacement, in effective lengths.
const LARGEST_PULL: f64 = 4.5;

/// Settings of [`uniaxial_stand_in`].
#[derive(Clone, Copy, Debug)]
pub struct UniaxialStandInOptions {
    /// Element size of the truth relative to standard.
    pub truth_factor: f64,
    /// Element size of the conversion relative to standard.
    pub fit_factor: f64,
    /// Noise of the load cell relative to the largest force, one standard deviation.
    pub relative_noise: f64,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for UniaxialStandInOptions {
    /// A fit on elements of 1.4 times the standard size to a truth on finer ones, with 0.2 % noise.
    fn default() -> Self {
        UniaxialStandInOptions { truth_factor: 0.75 * 1.4, fit_factor: 1.4, relative_noise: 2e-3, seed: 1 }
    }
}

/// One line of the table.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct UniaxialRow {
    /// Largest gauge stretch of the data that were fitted.
    pub largest_stretch: f64,
    /// The fit.
    pub fit: CurveFit,
    /// Σ(Δσ)²/Σσ².
    pub relative_squares: f64,
}

/// The table.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct UniaxialStandIn {
    /// ½Σμα of what made the data, kPa.
    pub true_initial_shear_modulus_kpa: f64,
    /// Rows in the paper's order.
    pub rows: Vec<UniaxialRow>,
    /// Largest difference of the gauge stretches found by the conversion from those of the truth.
    pub stretch_error: f64,
    /// Largest change of a gauge strain in the conversion's last round, relative to the largest strain.
    pub last_change: f64,
}

/// Makes the data and the fits.
///
/// # Errors
/// [`DumbbellError`].
pub fn uniaxial_stand_in(
    specimen: &Specimen,
    options: &UniaxialStandInOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<UniaxialStandIn, DumbbellError> {
    let modulus = initial_shear_modulus_kpa(&TRUTH);
    let truth = OgdenTerms::free(&TRUTH).material(BULK_RATIO * modulus);
    let truth_mesh = MeshOptions::scaled(specimen, options.truth_factor);
    let mut model = ForwardModel::of_specimen(specimen, &truth_mesh)?;
    let drawn = specimen.outline.dumbbell().zip(specimen.profile());
    let Some((gauge, profile)) = drawn else {
        return Err(DumbbellError::NotADumbbell { name: specimen.name.clone() });
    };
    let largest = LARGEST_PULL * profile.effective_length_mm();
    let drives: Vec<f64> = (1..=NUM_POINTS).map(|n| largest * n as f64 / NUM_POINTS as f64).collect();
    let mut recorded = Vec::new();
    // One after another: the pull ends at the gauge stretch, not at the displacement.
    for chunk in drives.chunks(4) {
        if recorded.last().is_some_and(|p: &super::dumbbell::GaugePoint| p.gauge_stretch > GAUGE_STRETCHES[1]) {
            break;
        }
        recorded.extend(gauge_stretches(&mut model, &truth, gauge.gauge_length_mm, chunk, is_cancelled)?);
    }
    recorded.retain(|p| p.gauge_stretch <= GAUGE_STRETCHES[1]);
    let top = recorded.iter().fold(0.0f64, |a, p| a.max(p.force_n));
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let displacement: Vec<f64> = recorded.iter().map(|p| p.displacement_mm).collect();
    let force: Vec<f64> = recorded
        .iter()
        .map(|p| {
            let noise: f64 = StandardNormal.sample(&mut rng);
            p.force_n + options.relative_noise * top * noise
        })
        .collect();
    let fits = |neo_hookean: bool, max_terms: usize| CurveFitOptions {
        neo_hookean,
        max_terms,
        alpha_range: [-40.0, 40.0],
        ..CurveFitOptions::default()
    };
    let route = DumbbellOptions {
        mesh: MeshOptions::scaled(specimen, options.fit_factor),
        fit: fits(false, 3),
        max_rounds: 16,
        tolerance: 1e-3,
    };
    let free = fit_dumbbell(specimen, &displacement, &force, &route, is_cancelled)?;
    let stretch_error =
        free.stretch.iter().zip(&recorded).map(|(a, p)| (a - p.gauge_stretch).abs()).fold(0.0, f64::max);
    let curve_to = |limit: f64| {
        let kept: Vec<(f64, f64)> = free
            .stretch
            .iter()
            .copied()
            .zip(free.nominal_stress_kpa.iter().copied())
            .filter(|p| p.0 <= limit)
            .collect();
        let (stretch, stress): (Vec<f64>, Vec<f64>) = kept.into_iter().unzip();
        Curve::new("uniaxial", HomogeneousTest::Uniaxial, &stretch, &stress)
    };
    let [low, full] = [curve_to(GAUGE_STRETCHES[0])?, curve_to(f64::MAX)?];
    let mut rows = Vec::new();
    let mut add = |curve: &Curve, largest_stretch: f64, options: &CurveFitOptions, from: usize| {
        let sequence = fit_curves(std::slice::from_ref(curve), options)?;
        for fit in sequence.fits.into_iter().filter(|f| f.num_terms >= from) {
            let relative_squares = fit.curves.iter().map(|c| c.relative_rms_error.powi(2)).sum();
            rows.push(UniaxialRow { largest_stretch, fit, relative_squares });
        }
        Ok::<(), DumbbellError>(())
    };
    add(&low, GAUGE_STRETCHES[0], &fits(true, 1), 1)?;
    add(&low, GAUGE_STRETCHES[0], &fits(false, 1), 1)?;
    add(&full, GAUGE_STRETCHES[1], &fits(true, 3), 2)?;
    add(&full, GAUGE_STRETCHES[1], &fits(false, 3), 1)?;
    Ok(UniaxialStandIn { true_initial_shear_modulus_kpa: modulus, rows, stretch_error, last_change: free.last_change })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rows of the table, from a pull on one mesh converted on another.
    #[test]
    fn the_traditional_route_finds_the_initial_modulus() {
        let specimen = Specimen::from_json(include_str!("../../geometries/iso37-type4.json")).unwrap();
        let options = UniaxialStandInOptions { truth_factor: 1.5, fit_factor: 2.0, relative_noise: 1e-3, seed: 1 };
        let found = uniaxial_stand_in(&specimen, &options, &|| false).unwrap();
        let rows: Vec<(f64, usize, bool)> =
            found.rows.iter().map(|r| (r.largest_stretch, r.fit.num_terms, r.fit.neo_hookean)).collect();
        let expected = [(2.0, 1, true), (2.0, 1, false), (4.0, 2, true), (4.0, 3, true), (4.0, 1, false)];
        assert_eq!(rows[..5], expected);
        for row in &found.rows {
            let g = row.fit.initial_shear_modulus_kpa.value;
            // One free term over the whole curve is a wrong model; the others are within the noise's and the meshes'
            // reach.
            if row.fit.num_terms > 1 || row.largest_stretch < 3.0 {
                assert!((g / found.true_initial_shear_modulus_kpa - 1.0).abs() < 0.1, "{g}");
            }
        }
        assert!(found.stretch_error < 0.05, "{}", found.stretch_error);
        // What is left is noise, 10⁻³ of the largest force (squared, over the mean square, 3·10⁻⁶), and the conversion
        // between meshes; a wrong model leaves far more.
        let left = |row: usize| found.rows[row].relative_squares;
        assert!(left(2) < 3e-5 && left(4) > 10.0 * left(2), "{} {}", left(2), left(4));
    }
}
