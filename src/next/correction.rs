//! The error of the coarse mesh, extrapolated from a finer one and taken off what was measured (deferred correction).
//!
//! Without it the coarse mesh's own error would count as a misfit of the law, and would shift the estimates by more
//! than the noise does: those of a block of 12 × 4 × 9 mm, sheared by 4 or 5 mm, by 1.7 to 2.6 standard deviations of
//! one scan. Exponents are told by singular edges, where errors fall slowly: a mesh of half the size leaves 0.6 to 0.9
//! of these, one of a third 0.3 to 0.4. Extrapolated with the order of such edges at most 0.2 are left of what a mesh
//! shows whose elements are half of the standard ones; still finer ones show more at the edges. A finer mesh of three
//! tenths of the size, or of two fifths where specimens are large or drives are many, is what an answer in seconds has
//! time for.

use super::body::is_same_body;
use super::error::NextError;
use super::error_left::ErrorLeft;
use super::two_meshes::TwoMeshes;
use crate::calibration::{CalibrationProblem, Observed, RecordingFit, SD_OVER_SHIFT};
use crate::fem::{Equilibrium, ForwardModel, side_by_side};
use crate::mesh::{MeshOptions, error_over_difference, sd_over_extrapolated};
use crate::specimen::Specimen;

/// The smallest and the largest element size of finer meshes as a factor on that of the fit.
const FINER: [f64; 2] = [0.3, 0.4];
/// Elements that finer meshes have together, those of one counted for each of its drives, unless one of the two sizes
/// says otherwise: with more an answer takes longer than it may.
const NUM_ELEMENTS: f64 = 7500.0;
/// The smallest element size as a factor on the standard one.
const FINEST: f64 = 0.6;
/// Of a finer mesh whose element size is closer to ours than this factor the difference would be multiplied by more
/// than 2.5: nothing is taken off.
const HARDLY_FINER: f64 = 0.7;

/// Recordings with a finer mesh of each body.
pub(super) struct FinerMeshes<'a> {
    observed: &'a [Observed],
    /// Element size of the finer meshes as a factor on that of the fit's.
    ratio: f64,
    /// None where finer meshes would say nothing.
    bodies: Vec<Body>,
}

/// The recordings of one body.
struct Group {
    /// Their places.
    recordings: Vec<usize>,
    /// All their drives once, in the order of their sizes, mm.
    drives_mm: Vec<f64>,
}

/// A body that was recorded.
struct Body {
    recorded: Group,
    meshes: TwoMeshes,
}

impl<'a> FinerMeshes<'a> {
    /// Of `observed`, fitted on meshes of `mesh_factor`.
    ///
    /// # Errors
    /// [`NextError`] where a specimen cannot be meshed so.
    pub(super) fn new(observed: &'a [Observed], mesh_factor: f64) -> Result<FinerMeshes<'a>, NextError> {
        let groups = by_body(observed);
        let mesh_all = |factor: f64| -> Result<Vec<ForwardModel>, NextError> {
            let mesh = |group: &Group| {
                let specimen = &observed[group.recordings[0]].specimen;
                ForwardModel::of_specimen(specimen, &MeshOptions::scaled(specimen, factor))
            };
            let models = side_by_side(groups.iter().collect(), mesh);
            Ok(models.into_iter().collect::<Result<_, _>>()?)
        };
        let coarse = mesh_all(mesh_factor)?;
        let elements = |(group, m): (&Group, &ForwardModel)| group.drives_mm.len() * m.mesh().num_elements();
        let num_elements: usize = groups.iter().zip(&coarse).map(elements).sum();
        let ratio = ratio_of(num_elements).max(FINEST / mesh_factor);
        if ratio > HARDLY_FINER {
            return Ok(FinerMeshes { observed, ratio, bodies: Vec::new() });
        }
        let pairs = coarse.into_iter().zip(mesh_all(ratio * mesh_factor)?);
        let groups = groups.into_iter().zip(pairs);
        let body = |(recorded, (coarse, fine))| Body { recorded, meshes: TwoMeshes::new(coarse, fine) };
        Ok(FinerMeshes { observed, ratio, bodies: groups.map(body).collect() })
    }

    /// The recordings plus the error that the fit's mesh has with the law of `fit`, as the finer meshes tell it.
    ///
    /// # Errors
    /// [`NextError`] where a specimen has no equilibrium there.
    pub(super) fn without_mesh_error(
        &mut self,
        fit: &RecordingFit,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Vec<Observed>, NextError> {
        let (observed, whole) = (self.observed, error_over_difference(self.ratio));
        let told =
            side_by_side(self.bodies.iter_mut().collect(), |body| body.corrected(observed, fit, whole, is_cancelled));
        let mut all = observed.to_vec();
        for (r, recording) in told.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().flatten() {
            all[r] = recording;
        }
        Ok(all)
    }

    /// What the error may still be beyond what was taken off of `corrected`, the recordings of `problem`, by which
    /// `fit` was found.
    ///
    /// # Errors
    /// [`NextError::Calibration`]: nothing to compare.
    pub(super) fn error_left(
        &self,
        problem: &CalibrationProblem,
        fit: &RecordingFit,
        corrected: &[Observed],
    ) -> Result<ErrorLeft, NextError> {
        let told = self.without_extrapolation(corrected);
        let shift = problem.shift_to(fit, &told)?;
        Ok(ErrorLeft::new(self.sd_over_extrapolated(), fit, &shift, corrected, &told))
    }

    /// Standard deviation of what lies beyond the finer meshes, as a part of what is extrapolated. Around holes and
    /// notches the order of the error is not known: it may be anything from nothing to twice that.
    fn sd_over_extrapolated(&self) -> f64 {
        let is_plain = |specimen: &Specimen| specimen.samples().iter().all(|sample| sample.holes.is_empty());
        match self.observed.iter().all(|o| is_plain(&o.specimen)) {
            true => sd_over_extrapolated(self.ratio),
            false => SD_OVER_SHIFT,
        }
    }

    /// The recordings with no more of the error taken off than the finer meshes themselves tell, where `corrected` are
    /// those with all of it.
    fn without_extrapolation(&self, corrected: &[Observed]) -> Vec<Observed> {
        let told = 1.0 / error_over_difference(self.ratio);
        let between = |measured: f64, corrected: f64| measured + told * (corrected - measured);
        let mut all = self.observed.to_vec();
        for (recording, corrected) in all.iter_mut().zip(corrected) {
            for (step, corrected) in recording.steps.iter_mut().zip(&corrected.steps) {
                for (u, corrected) in step.displacement.iter_mut().zip(&corrected.displacement) {
                    *u = [0, 1, 2].map(|c| between(u[c], corrected[c]));
                }
            }
            for (force, corrected) in recording.forces_mut().zip(corrected.forces()) {
                if let (Some(force), Some(corrected)) = (force, corrected) {
                    force.value_n = between(force.value_n, corrected.value_n);
                }
            }
        }
        all
    }
}

/// Which recordings are of one body.
fn by_body(observed: &[Observed]) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for (r, recording) in observed.iter().enumerate() {
        let is_of = |group: &&mut Group| is_same_body(&observed[group.recordings[0]].specimen, &recording.specimen);
        let drives_mm = recording.all_drives_mm();
        match groups.iter_mut().find(is_of) {
            Some(group) => {
                group.recordings.push(r);
                group.drives_mm.extend(drives_mm);
            }
            None => groups.push(Group { recordings: vec![r], drives_mm }),
        }
    }
    for Group { drives_mm, .. } in &mut groups {
        drives_mm.sort_by(|a, b| a.abs().total_cmp(&b.abs()).then(a.total_cmp(b)));
        drives_mm.dedup();
    }
    groups
}

impl Body {
    /// Its recordings plus `whole` times the difference of the two meshes with the law of `fit`, with their places.
    ///
    /// # Errors
    /// As [`FinerMeshes::without_mesh_error`].
    fn corrected(
        &mut self,
        observed: &[Observed],
        fit: &RecordingFit,
        whole: f64,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Vec<(usize, Observed)>, NextError> {
        let Body { recorded: Group { recordings, drives_mm }, meshes } = self;
        let known_at = |drive_mm: &f64| {
            recordings.iter().find_map(|&r| {
                let place = observed[r].all_drives_mm().iter().position(|d| d == drive_mm)?;
                fit.states(r).get(place)
            })
        };
        let known: Vec<Option<&Equilibrium>> = drives_mm.iter().map(known_at).collect();
        let states = meshes.states(&fit.material, drives_mm, &known, is_cancelled)?;
        let mut corrected: Vec<(usize, Observed)> = Vec::new();
        for &r in recordings.iter() {
            let mut recording = observed[r].clone();
            let view = recording.view(&recording.specimen, meshes.fine_mesh())?;
            let own_drives_mm = recording.all_drives_mm();
            let at = |drive_mm: &f64| drives_mm.iter().position(|d| d == drive_mm).map(|place| &states[place]);
            let own: Vec<&[Equilibrium; 2]> = own_drives_mm.iter().filter_map(at).collect();
            for (s, (step, [_, fine])) in recording.steps.iter_mut().zip(&own).enumerate() {
                let fine = view.average(&fine.displacement)?;
                for ((u, fine), coarse) in step.displacement.iter_mut().zip(&fine).zip(fit.predicted(r, s)) {
                    *u = [0, 1, 2].map(|c| u[c] + whole * (coarse[c] - fine[c]));
                }
            }
            for (force, [coarse, fine]) in recording.forces_mut().zip(&own) {
                if let Some(force) = force {
                    force.value_n += whole * (coarse.force_n - fine.force_n);
                }
            }
            corrected.push((r, recording));
        }
        Ok(corrected)
    }
}

/// Element size of the finer meshes as a factor on that of coarse ones of so many elements, counted for each drive:
/// they have as many elements as an answer has time for.
fn ratio_of(num_elements: usize) -> f64 {
    (num_elements as f64 / NUM_ELEMENTS).cbrt().clamp(FINER[0], FINER[1])
}

#[cfg(test)]
mod tests {
    use super::super::discrepancy::Discrepancy;
    use super::*;
    use crate::calibration::{FitOptions, Objective, SyntheticScan};
    use crate::fem::SolveOptions;
    use crate::material::{Material, Parameter};
    use crate::recording::Filter;
    use crate::sensitivity::{Protocol, ScanSettings};

    const COARSE: f64 = 2.5;

    fn block(drive_mm: f64) -> Specimen {
        let block = Specimen::from_json(
            r#"{ "schema": "specimen/1", "name": "block", "test": "double_lap_shear", "drive_mm": [4.0], "holes": [],
                "block": { "length_mm": 12.0, "thickness_mm": 4.0, "width_mm": 9.0 }, "samples_in_parallel": 2 }"#,
        );
        Specimen { drive_mm: vec![drive_mm], ..block.unwrap() }
    }

    /// Without noise, of a fine mesh, compared as if there were noise of `noise_mm`; the force at 2 mm was read on the
    /// way to 4 mm.
    fn scanned(truth: &Material, noise_mm: f64) -> [Observed; 1] {
        [scanned_at(4.0, truth, noise_mm)]
    }

    fn scanned_at(drive_mm: f64, truth: &Material, noise_mm: f64) -> Observed {
        let specimen = block(drive_mm);
        let noise_sd_mm = [noise_mm; 3];
        let settings = ScanSettings { voxel_mm: [1.0, 0.5, 1.0], noise_sd_mm, ..ScanSettings::default() };
        let fine = MeshOptions { grading: 0.4, ..MeshOptions::scaled(&specimen, 0.6) };
        let (protocol, solve) =
            (Protocol { force_drive_mm: vec![2.0], ..Protocol::default() }, SolveOptions::default());
        let scan = SyntheticScan::new(&specimen, truth, &settings, &protocol, &fine, &solve, &|| false).unwrap();
        let made = scan.recording("block", &specimen, scan.noiseless(), Filter::None).unwrap();
        let observed = Observed::new(&made, settings.force_sd_n).unwrap();
        let mut observed = observed.with_protocol(&made, &protocol, settings.force_sd_n).unwrap();
        observed.noise_sd_mm = noise_sd_mm;
        observed
    }

    fn problem(observed: &[Observed]) -> CalibrationProblem<'_> {
        let mesh = |s: &Specimen| MeshOptions::scaled(s, COARSE);
        CalibrationProblem::new(observed, &mesh, Objective::Weighted).unwrap()
    }

    fn fit(problem: &CalibrationProblem) -> RecordingFit {
        problem.fit(&one_term(), None, &FitOptions::default(), &|| false).unwrap()
    }

    fn one_term() -> Material {
        Material::new(400.0, [(17.0, 1.91)]).unwrap()
    }

    /// Without noise, a coarse mesh misses the law by more than one standard deviation of a usual scan. With its error
    /// taken off less than a third of that is left: a twentieth by the figures above, and a seventh (0.6^1.4 / 2.5^1.4)
    /// by the error of the mesh that the data are made on.
    #[test]
    fn most_of_the_error_is_told() {
        let truth = one_term();
        let observed = scanned(&truth, 0.05);
        let missed_by = |fit: &RecordingFit| -> f64 {
            let sds = |p: &Parameter| ((fit.material.value(*p) - truth.value(*p)) / fit.sd(*p).unwrap()).abs();
            fit.material.parameters().iter().skip(1).map(sds).fold(0.0, f64::max)
        };
        let coarse = fit(&problem(&observed));
        let corrected = FinerMeshes::new(&observed, COARSE).unwrap().without_mesh_error(&coarse, &|| false).unwrap();
        let [before, after] = [&coarse, &fit(&problem(&corrected))].map(missed_by);
        assert!(before > 1.0 && after < before / 3.0, "{before} {after}");
    }

    /// Two scans of one body share a finer mesh, on which the larger drive may start from the smaller one. What is
    /// taken off is what each alone would have taken off, up to what equilibria are solved to.
    #[test]
    fn recordings_of_one_body_share_its_meshes() {
        let law = one_term();
        let both = [5.0, 3.0].map(|drive_mm| scanned_at(drive_mm, &law, 0.05));
        let corrected = |observed: &[Observed]| {
            let fit = problem(observed).at(&law, &|| false).unwrap();
            let mut finer = FinerMeshes::new(observed, COARSE).unwrap();
            assert_eq!(finer.bodies.len(), 1);
            finer.without_mesh_error(&fit, &|| false).unwrap()
        };
        let together = corrected(&both);
        for (before, together) in both.iter().zip(&together) {
            let alone = &corrected(std::slice::from_ref(before))[0];
            let differences = |a: &Observed, b: &Observed| {
                let pairs = a.steps[0].displacement.iter().flatten().zip(b.steps[0].displacement.iter().flatten());
                pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
            };
            let (taken_off, apart) = (differences(before, together), differences(alone, together));
            assert!(taken_off > 1e-3 && apart < 1e-3 * taken_off, "{taken_off} {apart}");
        }
    }

    /// Finer meshes are the finer the fewer elements there are, within the two limits.
    #[test]
    fn few_elements_are_made_finer() {
        assert_eq!([ratio_of(1), ratio_of(10_000_000)], FINER);
        let between = ratio_of(320);
        assert!(
            between > FINER[0] && between < FINER[1] && (320.0 / between.powi(3) / NUM_ELEMENTS - 1.0).abs() < 1e-9
        );
    }

    /// The force that was read on the way is corrected as that of the scan is, though the fit that tells the error
    /// knows of the scan alone: less than a third of what the coarse mesh is wrong by is left.
    #[test]
    fn forces_on_the_way_are_corrected() {
        let truth = one_term();
        let observed = scanned(&truth, 0.05);
        let scan = observed.each_ref().map(Observed::without_readings);
        let told = fit(&problem(&scan));
        let corrected = FinerMeshes::new(&observed, COARSE).unwrap().without_mesh_error(&told, &|| false).unwrap();
        let coarse_n = &problem(&observed).force_at(&truth, &|| false).unwrap()[0];
        let errors_n = |o: &Observed| -> Vec<f64> {
            o.forces().zip(coarse_n).map(|(force, coarse)| (force.unwrap().value_n - coarse).abs()).collect()
        };
        let (before, after) = (errors_n(&observed[0]), errors_n(&corrected[0]));
        assert_eq!(before.len(), 2);
        for (before, after) in before.iter().zip(&after) {
            assert!(*after < before / 3.0, "{before} {after}");
        }
    }

    /// With hardly any noise what the mesh leaves is seen. Part of it is told by what was extrapolated, which says
    /// nothing against the law; the misfit of a law that is wrong is found all the same.
    #[test]
    fn what_the_mesh_leaves_is_not_said_against_the_law() {
        const NOISE_MM: f64 = 1e-4;
        let largest = |d: &Discrepancy| d.variance_mm2.into_iter().fold(0.0, f64::max);
        let of = |truth: &Material| -> [f64; 2] {
            let observed = scanned(truth, NOISE_MM);
            let mut finer = FinerMeshes::new(&observed, COARSE).unwrap();
            let coarse = fit(&problem(&observed));
            let corrected = finer.without_mesh_error(&coarse, &|| false).unwrap();
            let problem = problem(&corrected);
            let fit = fit(&problem);
            let left = finer.error_left(&problem, &fit, &corrected).unwrap();
            let nothing = ErrorLeft::none(&corrected, fit.material.parameters().len());
            [&nothing, &left].map(|mesh| largest(&Discrepancy::of(&corrected, &fit, mesh)))
        };
        let [seen, beyond_mesh] = of(&one_term());
        assert!(seen > 0.0 && beyond_mesh < 0.95 * seen, "{seen} {beyond_mesh}");
        let [seen_wrong, beyond_mesh] = of(&Material::new(400.0, [(12.0, 3.0), (-4.0, -3.0)]).unwrap());
        assert!(seen_wrong > 2.0 * seen && beyond_mesh > 0.9 * seen_wrong, "{seen} {seen_wrong} {beyond_mesh}");
    }
}
