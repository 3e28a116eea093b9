//! The sample that is recorded, driven to its steps: what scanner, cameras and load cell see without noise.

use super::AcquisitionError;
use crate::fem::{Equilibrium, ForwardModel, SolveError, SolveOptions};
use crate::homogeneous::ForceTable;
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::specimen::Specimen;
use crate::voxel::{Sampling, VoxelGrid, VoxelMask, VoxelOperator};

/// On the ramps the force is solved for at drives that lie no farther apart than this part of the largest. Between
/// them the cubic of [`ForceTable`] errs by at most 0.14 % of the largest force for a material near the end of its
/// chains (Gent's in simple shear of 1.09, with a J_m of 2.5), and by 0.013 % where J_m is 6 or an exponent is 5.
const RAMP_PART: f64 = 1.0 / 12.0;

/// One kind of a specimen's samples at all drives, and the force of all samples.
pub(super) struct DrivenSample {
    /// The sample alone.
    pub sample: Specimen,
    /// The specimen with this sample listed first.
    pub recorded: Specimen,
    pub model: ForwardModel,
    /// One per drive.
    pub path: Vec<Equilibrium>,
    /// Voxels at least half filled.
    pub mask: VoxelMask,
    /// Voxel averages of the displacement, mm, per drive in the mask's order.
    pub truth: Vec<Vec<[f64; 3]>>,
    /// N, per drive.
    pub forces_n: Vec<f64>,
    /// The force along the drive over the distance from rest, N over mm.
    pub force: ForceTable,
}

impl DrivenSample {
    /// Solves `material` at the drives of `specimen`, of which the kind of sample with number `index`, from 0, is
    /// recorded on `grid`.
    ///
    /// # Errors
    /// [`AcquisitionError`].
    pub fn new(
        specimen: &Specimen,
        index: usize,
        material: &Material,
        mesh: &MeshOptions,
        solve: &SolveOptions,
        grid: &VoxelGrid,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<DrivenSample, AcquisitionError> {
        let samples = specimen.samples();
        let (Some(sample), Some(recorded)) = (samples.get(index), specimen.with_first(index)) else {
            let requirement = "the number of a kind of the specimen's samples, from 0";
            return Err(AcquisitionError::Value { name: "the sample", value: index as f64, requirement });
        };
        let mask = VoxelMask::of_specimen(sample, grid.clone())?;
        let mut model = ForwardModel::of_specimen(sample, &mesh.carried(specimen, sample))?;
        let path = model.solve_path(material, &sample.drive_mm, solve, is_cancelled)?;
        let operator = VoxelOperator::new(sample, model.mesh(), &mask, Sampling::default())?;
        let truth = path.iter().map(|state| operator.average(&state.displacement)).collect::<Result<Vec<_>, _>>()?;
        let mut forces_n: Vec<f64> = path.iter().map(|state| state.force_n).collect();
        let ramps_mm = on_the_ramps(&specimen.drive_mm);
        let mut on_ramps_n = forces_on_ramps(&mut model, material, &path, &ramps_mm, solve, is_cancelled)?;
        for (_, other) in samples.iter().enumerate().filter(|(n, _)| *n != index) {
            let mut model = ForwardModel::of_specimen(other, &mesh.carried(specimen, other))?;
            let path = model.solve_path(material, &other.drive_mm, solve, is_cancelled)?;
            let of_other = forces_on_ramps(&mut model, material, &path, &ramps_mm, solve, is_cancelled)?;
            on_ramps_n.iter_mut().zip(of_other).for_each(|(sum, force)| *sum += force);
            forces_n.iter_mut().zip(path).for_each(|(sum, state)| *sum += state.force_n);
        }
        let steps = specimen.drive_mm.iter().copied().zip(forces_n.iter().copied());
        let force = force_table(steps.chain(ramps_mm.into_iter().zip(on_ramps_n)))?;
        Ok(DrivenSample { sample: sample.clone(), recorded, model, path, mask, truth, forces_n, force })
    }
}

/// Drives on the way from rest to the farthest of `steps_mm`, between those of the steps.
fn on_the_ramps(steps_mm: &[f64]) -> Vec<f64> {
    let mut all: Vec<f64> = steps_mm.iter().copied().chain([0.0]).collect();
    all.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let farthest_mm = all.last().map_or(0.0, |drive| drive.abs());
    let mut between = Vec::new();
    for ends in all.windows(2) {
        let (from, to) = (ends[0], ends[1]);
        let parts = ((to - from).abs() / (RAMP_PART * farthest_mm)).ceil();
        // A drive of zero alone has no ramp.
        let num = if parts.is_finite() { parts as usize } else { 0 };
        between.extend((1..num).map(|n| from + (to - from) * n as f64 / parts));
    }
    between
}

/// Forces at drives between the steps of `path`, N, each from the equilibrium before it.
fn forces_on_ramps(
    model: &mut ForwardModel,
    material: &Material,
    path: &[Equilibrium],
    ramps_mm: &[f64],
    solve: &SolveOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<f64>, SolveError> {
    let mut last: Option<Equilibrium> = None;
    let mut forces = Vec::with_capacity(ramps_mm.len());
    for &drive in ramps_mm {
        let known = path.iter().chain(&last).filter(|state| state.drive_mm.abs() < drive.abs());
        let start = known.max_by(|a, b| a.drive_mm.abs().total_cmp(&b.drive_mm.abs())).cloned();
        let state = model.solve(material, drive, start.as_ref(), solve, is_cancelled)?;
        forces.push(state.force_n);
        last = Some(state);
    }
    Ok(forces)
}

/// The table through rest and points of drive and force, in any order.
fn force_table(points: impl Iterator<Item = (f64, f64)>) -> Result<ForceTable, AcquisitionError> {
    let mut all: Vec<(f64, f64)> = points.map(|(drive, force)| (drive.abs(), force)).chain([(0.0, 0.0)]).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.dedup_by(|a, b| a.0 == b.0);
    // A specimen that is not driven has no force along the drive.
    if all.len() == 1 {
        all.push((1.0, 0.0));
    }
    let (drives, forces): (Vec<f64>, Vec<f64>) = all.into_iter().unzip();
    Ok(ForceTable::new(&drives, &forces)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Between the steps of a scan the load curve is that of equilibria there, not a curve through the steps: for a
    /// material that stiffens these differ by percents.
    #[test]
    fn ramps_follow_equilibria() {
        let specimen = Specimen::from_json(include_str!("../../geometries/solid-shear.json")).unwrap();
        let stiffening = Material::new(2000.0, [(15.0, 2.0), (0.1, 12.0)]).unwrap();
        let grid = VoxelGrid::covering(&specimen, [2.0, 0.8, 2.0]).unwrap();
        let mesh = MeshOptions::scaled(&specimen, 4.0);
        let options = SolveOptions::default();
        let driven = DrivenSample::new(&specimen, 0, &stiffening, &mesh, &options, &grid, &|| false).unwrap();
        let DrivenSample { mut model, force, forces_n, .. } = driven;
        let through_steps = force_table([2.5, 5.0, 7.0].into_iter().zip(forces_n)).unwrap();
        let mut largest = [0.0f64; 2];
        for drive in [1.0, 3.6, 5.4, 6.1, 6.7] {
            let truth = model.solve(&stiffening, drive, None, &options, &|| false).unwrap().force_n;
            for (largest, table) in largest.iter_mut().zip([&force, &through_steps]) {
                *largest = largest.max((table.at(drive).unwrap().0 / truth - 1.0).abs());
            }
        }
        // The cubic between equilibria a twelfth apart, and for comparison the one through the steps alone.
        assert!(largest[0] < 1e-3 && largest[1] > 1e-2, "{largest:?}");
    }
}
