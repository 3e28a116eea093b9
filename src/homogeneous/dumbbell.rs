//! The traditional route: a dumb-bell's force over grip displacement, converted to the gauge's stretch by finite
//! elements.
//!
//! Shoulders and grips take part of the displacement, and how much depends on the material's curve. Conversion and fit
//! are repeated in turn: fit → finite elements at a few displacements → gauge stretch over displacement → fit, until
//! the stretches stay where they are.

use super::curve::{Curve, CurveError};
use super::deformation::HomogeneousTest;
use super::fit::BULK_OVER_SHEAR;
use super::fit_options::{CurveFitError, CurveFitOptions};
use super::result::{CurveFitSequence, fit_curves};
use super::table::{ForceTable, TableError};
use crate::fem::{ForwardModel, PrepareError, SolveError, SolveOptions};
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};

/// The part of the gauge about its middle over which stretches are averaged: well inside it, where an extensometer
/// would sit.
const MEASURED_PART: f64 = 0.5;
/// Displacements at which the finite elements are solved.
const NUM_DRIVES: usize = 8;

/// Settings of [`fit_dumbbell`].
#[derive(Clone, Debug)]
pub struct DumbbellOptions {
    /// Mesh of the dumb-bell.
    pub mesh: MeshOptions,
    /// Settings of the fits.
    pub fit: CurveFitOptions,
    /// Most rounds of conversion and fit.
    pub max_rounds: usize,
    /// Converged when no gauge strain changes by more than this part of the largest one.
    pub tolerance: f64,
}

/// Grip-to-gauge conversion of one displacement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct GaugePoint {
    /// Displacement of the grips, mm.
    pub displacement_mm: f64,
    /// Mean stretch of the gauge.
    pub gauge_stretch: f64,
    /// Force of all samples by the finite elements, N.
    pub force_n: f64,
}

/// Fits of a dumb-bell's curve with the conversion that belongs to them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct DumbbellFit {
    /// The fits.
    pub sequence: CurveFitSequence,
    /// Displacement to gauge stretch, of the chosen material.
    pub conversion: Vec<GaugePoint>,
    /// Stretch of each sample.
    pub stretch: Vec<f64>,
    /// Nominal stress of each sample, kPa.
    pub nominal_stress_kpa: Vec<f64>,
    /// Rounds of conversion and fit.
    pub num_rounds: usize,
    /// Largest change of a gauge strain in the last round, relative to the largest strain.
    pub last_change: f64,
    /// Largest |finite element force − data| relative to the largest force: the whole route checked against the raw
    /// data.
    pub force_mismatch: f64,
    /// κ of the finite elements, kPa.
    pub bulk_kpa: f64,
}

/// Why the traditional route has no result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DumbbellError {
    /// Not a uniaxial dumb-bell.
    #[error(
        "specimen {name:?} has no dumb-bell outline; give one with outline iso37_type4 or dumbbell, and without holes"
    )]
    NotADumbbell {
        /// The specimen's name.
        name: String,
    },
    /// The displacements.
    #[error(
        "the largest displacement is {largest_mm} mm; a conversion needs displacements ≥ 0 that rise to a positive one"
    )]
    Displacement {
        /// Largest displacement, mm.
        largest_mm: f64,
    },
    /// No model of the dumb-bell.
    #[error(transparent)]
    Prepare(#[from] PrepareError),
    /// No equilibrium, or cancelled.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// No fit.
    #[error(transparent)]
    Fit(#[from] CurveFitError),
    /// The curve.
    #[error(transparent)]
    Curve(#[from] CurveError),
    /// The conversion is not monotone.
    #[error(transparent)]
    Table(#[from] TableError),
}

/// Gauge stretch and force of a dumb-bell of this material at each displacement (mm), by finite elements. `gauge_mm`
/// is the length of its gauge, of which the middle half counts.
///
/// # Errors
/// [`DumbbellError::Solve`].
pub fn gauge_stretches(
    model: &mut ForwardModel,
    material: &Material,
    gauge_mm: f64,
    displacement_mm: &[f64],
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<GaugePoint>, SolveError> {
    let half_mm = 0.5 * MEASURED_PART * gauge_mm;
    let path = model.solve_path(material, displacement_mm, &SolveOptions::default(), is_cancelled)?;
    Ok(path
        .iter()
        .map(|state| {
            let (mut sum, mut volume) = (0.0, 0.0);
            for q in model.quadrature_fields(material, state) {
                if q.position[0].abs() <= half_mm {
                    sum += q.volume_mm3 * q.deformation_gradient[0][0];
                    volume += q.volume_mm3;
                }
            }
            GaugePoint { displacement_mm: state.drive_mm, gauge_stretch: sum / volume, force_n: state.force_n }
        })
        .collect())
}

/// Fits a dumb-bell's force (N, all samples) over grip displacement (mm).
///
/// # Errors
/// [`DumbbellError`].
pub fn fit_dumbbell(
    specimen: &Specimen,
    displacement_mm: &[f64],
    force_n: &[f64],
    options: &DumbbellOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<DumbbellFit, DumbbellError> {
    let drawn = specimen.outline.dumbbell().zip(specimen.profile()).filter(|_| specimen.holes.is_empty());
    let Some((gauge, profile)) = drawn else {
        return Err(DumbbellError::NotADumbbell { name: specimen.name.clone() });
    };
    let largest = displacement_mm.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b));
    let smallest = displacement_mm.iter().fold(f64::INFINITY, |a, b| a.min(*b));
    if !(largest > 0.0 && largest.is_finite() && smallest > -0.01 * largest) {
        return Err(DumbbellError::Displacement { largest_mm: largest });
    }
    let area = gauge.gauge_width_mm * specimen.block.thickness_mm;
    let samples = f64::from(specimen.samples_in_parallel);
    let stress: Vec<f64> = force_n.iter().map(|f| 1e3 * f / (area * samples)).collect();
    let mut model = ForwardModel::of_specimen(specimen, &options.mesh)?;
    // Denser where the conversion curves: towards small displacements.
    let drives: Vec<f64> = (1..=NUM_DRIVES).map(|i| largest * (i as f64 / NUM_DRIVES as f64).powf(1.5)).collect();
    let length = profile.effective_length_mm();
    let mut stretch: Vec<f64> = displacement_mm.iter().map(|d| 1.0 + d / length).collect();
    let mut round = 0;
    loop {
        round += 1;
        let curve = Curve::new("uniaxial", HomogeneousTest::Uniaxial, &stretch, &stress)?;
        let sequence = fit_curves(&[curve], &options.fit)?;
        let chosen = sequence.chosen();
        let bulk_kpa = options.fit.bulk_kpa.unwrap_or(BULK_OVER_SHEAR * chosen.initial_shear_modulus_kpa.value);
        let material = chosen.fitted_law().material(bulk_kpa);
        let conversion = gauge_stretches(&mut model, &material, gauge.gauge_length_mm, &drives, is_cancelled)?;
        let at: Vec<f64> = std::iter::once(0.0).chain(conversion.iter().map(|c| c.displacement_mm)).collect();
        let gauge: Vec<f64> = std::iter::once(1.0).chain(conversion.iter().map(|c| c.gauge_stretch)).collect();
        let table = ForceTable::new(&at, &gauge)?;
        let next = table.forces(displacement_mm)?;
        let strain = next.iter().fold(0.0f64, |a, s| a.max((s - 1.0).abs()));
        let last_change = next.iter().zip(&stretch).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / strain;
        if last_change <= options.tolerance || round >= options.max_rounds {
            let forces: Vec<f64> = std::iter::once(0.0).chain(conversion.iter().map(|c| c.force_n)).collect();
            let modelled = ForceTable::new(&at, &forces)?.forces(displacement_mm)?;
            let top = force_n.iter().fold(1e-300f64, |a, f| a.max(f.abs()));
            let force_mismatch = modelled.iter().zip(force_n).map(|(m, f)| (m - f).abs()).fold(0.0, f64::max) / top;
            return Ok(DumbbellFit {
                sequence,
                conversion,
                stretch,
                nominal_stress_kpa: stress,
                num_rounds: round,
                last_change,
                force_mismatch,
                bulk_kpa,
            });
        }
        stretch = next;
    }
}
