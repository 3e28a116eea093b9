//! A whole calibration: number of terms, estimate, uncertainty, and what the mesh adds to it.
//!
//! Terms are chosen on a mesh coarser than the one asked for, from several starts. The chosen model and the one with a
//! term less are then fitted again on the mesh asked for: the difference of the estimates tells the discretisation's
//! error (see [`super::allowance`]), and a term that the finer mesh does not ask for was the coarse mesh's and is
//! dropped.

use super::allowance::{Allowance, MESH_RATIO, error_over_shift};
use super::calibrate_options::CalibrateOptions;
use super::contours::contours;
use super::error::CalibrationError;
use super::interval::{TWO_SIDED_95, widened};
use super::observed::Observed;
use super::outcome::{Calibration, Estimate, MeshComparison};
use super::problem::CalibrationProblem;
use super::profile::{bulk_lower_bound_kpa, profile};
use super::recording_fit::RecordingFit;
use super::run::{Run, with_falling_exponents};
use super::starts::Candidates;
use super::target::Objective;
use super::terms::{DecidedBy, compare, is_kept};
use super::weak_intervals::{Ends, ends_by_noise, is_weak};
use crate::material::Parameter;
use crate::mesh::MeshOptions;
use crate::sensitivity::IDENTIFIABILITY_LIMIT;
use crate::specimen::Specimen;

/// Calibrates on `observed`. `mesh` gives the settings for an element size relative to standard; `on_stage` is told
/// what comes next.
///
/// # Errors
/// [`CalibrationError`]: nothing to compare, no equilibrium, no converged fit.
pub fn calibrate(
    observed: &[Observed],
    mesh: &dyn Fn(&Specimen, f64) -> MeshOptions,
    options: &CalibrateOptions,
    on_stage: &dyn Fn(&str),
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Calibration, CalibrationError> {
    let coarse_factor = options.mesh_factor * if options.has_mesh_allowance { MESH_RATIO } else { 1.0 };
    let mut problem = CalibrationProblem::new(observed, &|s| mesh(s, coarse_factor), options.objective)?;
    let has_force = problem.has_force();
    let mut run = Run::new(options, has_force, on_stage, is_cancelled);
    let (mut selection, fits) = run.select_terms(&problem)?;
    let mut coarse = fits[selection.chosen - 1].clone();
    let mut meshes = None;
    let mut fit = coarse.clone();
    if options.has_mesh_allowance {
        on_stage("finer mesh");
        let finer = CalibrationProblem::new(observed, &|s| mesh(s, options.mesh_factor), options.objective)?;
        fit = run.fit(&finer, &with_falling_exponents(&coarse.material), None)?;
        while selection.chosen > 1 && selection.decided_by != DecidedBy::Fixed {
            let fewer = &fits[selection.chosen - 2];
            let smaller = run.fit(&finer, &with_falling_exponents(&fewer.material), None)?;
            let mut pair = vec![run.row(&finer, &smaller, 1, 1)?, run.row(&finer, &fit, 1, 1)?];
            // What a discretisation error within the allowance could make a term of is no evidence for one.
            let start = run.fit(&problem, &fewer.material, Some(fewer))?;
            let candidates = Candidates::new(&problem, &start, &run.fit_options, is_cancelled)?;
            let of_mesh = (options.discretisation_factor * error_over_shift()).powi(2)
                * candidates.promise_of_mesh(&problem.targets()?, &smaller);
            pair[0].chi2 = (pair[0].chi2 - of_mesh).max(pair[1].chi2);
            compare(&mut pair, fit.num_data);
            if is_kept(&pair[1], options.rule, options.decrement_threshold) {
                break;
            }
            run.notes.push(format!(
                "term {} is the mesh's: on the finer mesh it lowers χ² by {:.1} only, beyond the {of_mesh:.1} that \
                 discretisation errors within the allowance could make",
                selection.chosen,
                pair[1].chi2_decrease.unwrap_or(0.0)
            ));
            selection.chosen -= 1;
            coarse = fewer.clone();
            fit = smaller;
        }
        let sum = |p: &CalibrationProblem| p.num_unknowns().iter().sum();
        let num_unknowns = [sum(&problem), sum(&finer)];
        coarse = run.fit(&problem, &with_falling_exponents(&coarse.material), None)?;
        let allowance = Allowance::new(&fit, &coarse, &finer.targets()?, options.discretisation_factor);
        fit.structured_misfit = allowance.unexplained(fit.structured_misfit);
        meshes = Some(MeshComparison { num_unknowns, coarse: coarse.material.clone(), allowance });
        problem = finer;
    } else {
        fit = run.in_order(&problem, fit)?;
    }
    run.settle(&fit)?;
    if is_weak(&fit) {
        on_stage("profiles of weakly known terms");
    }
    let of_noise = ends_by_noise(&problem, &fit, &run.fit_options, is_cancelled)?;
    if is_weak(&fit) {
        let how = match of_noise.are_of_profiles {
            true => {
                "the intervals of moduli and exponents are those of their profile likelihoods, which follow the valley that \
                 the data leave open"
            }
            false => {
                "a material along the valley that the data leave open has no equilibrium, so that the intervals are those of \
                 the linear model and may be too short"
            }
        };
        run.notes.push(format!("terms are hardly told apart: {how}"));
    }
    let mut estimates: Vec<Estimate> = Vec::new();
    for (parameter, ends) in fit.material.parameters().into_iter().zip(&of_noise.ends) {
        let value = fit.material.value(parameter);
        let mesh_error = meshes.as_ref().map_or(0.0, |m| m.allowance.mesh_error_of(parameter, &fit, &m.coarse));
        // Symmetric intervals say nothing of what is not identifiable; profiles do.
        let ends = ends
            .filter(|_| is_identifiable(&fit, parameter) || parameter != Parameter::Kappa && of_noise.are_of_profiles);
        estimates.push(estimate(&fit, parameter, value, ends, mesh_error, options.discretisation_factor));
    }
    // Without forces κ is in proportion to the μ₁ that was assumed.
    if has_force && !estimates[0].is_identifiable && !fit.held.contains(0) && options.objective == Objective::Weighted {
        on_stage("bound of kappa");
        estimates[0].interval_95 = [bulk_lower_bound_kpa(&problem, &fit, &run.fit_options, is_cancelled)?, None];
    }
    let initial_shear_modulus = has_force.then(|| {
        let (value, sd) = fit.initial_shear_modulus();
        let gradient = fit.material.initial_shear_modulus_derivatives();
        let error = meshes.as_ref().map_or(0.0, |m| {
            let by_curvature = fit.information.covariance().sd_along(&gradient);
            m.allowance.mesh_error(value - m.coarse.initial_shear_modulus_kpa(), by_curvature)
        });
        // The shift of a sum of parameters is bounded by its own standard deviation likewise.
        let shift = sd.unwrap_or(0.0) / fit.misfit_factor.sqrt() * fit.structured_misfit;
        let error = options.discretisation_factor * error;
        (value, sd.map(|sd| [-1.0, 1.0].map(|s| value + s * half_width(sd, error, shift))))
    });
    let mut profiles = Vec::new();
    if options.has_profiles {
        on_stage("profiles");
        profiles = profile(&problem, &fit, &run.fit_options, is_cancelled)?;
    }
    let mut around = Vec::new();
    if let Some(contour_options) = &options.contours {
        on_stage("contours");
        around = contours(&problem, &fit, contour_options, is_cancelled)?;
    }
    let mut stretches: Vec<f64> =
        problem.visited_stretches(&fit)?.iter().map(|s| s.iter().copied().fold(1.0, f64::max)).collect();
    stretches.sort_by(f64::total_cmp);
    let largest_stretch = stretches.get(stretches.len() * 99 / 100).copied().unwrap_or(1.0);
    run.remark(observed, &fit, has_force, meshes.as_ref());
    let (work, notes) = (run.work, run.notes);
    Ok(Calibration {
        fit,
        estimates,
        initial_shear_modulus,
        selection,
        meshes,
        profiles,
        contours: around,
        largest_stretch,
        has_force,
        work,
        notes,
    })
}

/// Noise and discretisation are independent; the misfit's shift adds up with them in full only in the worst case.
fn half_width(sd: f64, discretisation_sd: f64, possible_shift: f64) -> f64 {
    (TWO_SIDED_95 * sd.hypot(discretisation_sd)).hypot(possible_shift)
}

/// Whether the standard deviation is below half of the value.
pub(super) fn is_identifiable(fit: &RecordingFit, parameter: Parameter) -> bool {
    fit.sd(parameter).is_some_and(|sd| sd < IDENTIFIABILITY_LIMIT * fit.material.value(parameter).abs())
}

/// With `ends`, what the noise leaves the parameter, as far as they mean anything.
fn estimate(
    fit: &RecordingFit,
    parameter: Parameter,
    value: f64,
    ends: Option<Ends>,
    mesh_error: f64,
    factor: f64,
) -> Estimate {
    let sd = fit.sd(parameter);
    let possible_shift = fit.possible_shift(parameter).unwrap_or(0.0);
    let is_identifiable = is_identifiable(fit, parameter);
    let discretisation_sd = factor * mesh_error;
    let interval_95 = match ends {
        Some(ends) => widened(parameter, value, ends, discretisation_sd, possible_shift),
        None => [None; 2],
    };
    Estimate { parameter, value, sd, mesh_error, discretisation_sd, possible_shift, interval_95, is_identifiable }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::TermCount;
    use crate::calibration::test_problem::{block, same_mesh, truth};
    use crate::recording::Filter;

    /// A mask that marks a hole which is not drawn: what the scan holds there is noise.
    #[test]
    fn voxels_of_noise_are_left_out_and_told() {
        let (_, scan) = same_mesh(&truth());
        let mut recording = scan.recording("hole", &block(), scan.noiseless(), Filter::None).expect("a recording");
        let in_hole = |v: &usize| {
            let [i, _, k] = recording.grid.indices(*v);
            (5..8).contains(&i) && (3..6).contains(&k)
        };
        let hole: Vec<usize> = (0..recording.grid.num_voxels()).filter(in_hole).collect();
        for (n, &v) in hole.iter().enumerate() {
            // Far from smooth, and within what a wrapped phase can be.
            recording.steps[0].displacement[v] = [1, 2, 3].map(|c| 2.0 * ((n * c) as f64 * 2.399).sin());
        }
        let observed = [Observed::new(&recording, 0.01).expect("a recording to compare")];
        let options = CalibrateOptions {
            terms: TermCount::Fixed(1),
            mesh_factor: 2.5,
            has_mesh_allowance: false,
            num_starts: 1,
            ..CalibrateOptions::default()
        };
        let found = calibrate(&observed, &MeshOptions::scaled, &options, &|_| (), &|| false).expect("a calibration");
        for e in found.estimates.iter().filter(|e| e.parameter != Parameter::Kappa) {
            // Without noise elsewhere and on the data's own mesh; what little noise is taken for displacement shows.
            assert!((e.value / truth().value(e.parameter) - 1.0).abs() < 0.02, "{}: {}", e.parameter.name(), e.value);
        }
        let told = observed[0].num_outliers;
        assert!(told >= hole.len() && told < 3 * hole.len(), "{told} of {}", hole.len());
        assert!(found.notes.iter().any(|note| note.starts_with(&format!("{told} voxels hold no displacement"))));
    }
}
