//! Fits corrected by a finer mesh: what it predicts beyond the fitting mesh is taken off the data before they are
//! fitted (defect correction; Stetter, Numer. Math. 29, 1978). The error of the estimate is then that of the finer
//! mesh, at the price of two predictions on it.

use super::bench::Bench;
use super::error::CalibrationError;
use super::fit::{Fit, FitStart};
use super::synthetic::{Measurement, SyntheticScan};
use crate::fem::SolveOptions;
use crate::mesh::MeshOptions;
use crate::specimen::Specimen;

/// Predictions on the finer mesh: the second is made where the first correction leads.
const PASSES: usize = 2;

/// What a finer mesh predicts beyond the fitting mesh.
#[derive(Clone, Debug)]
pub(super) struct MeshDefect {
    /// Voxel displacements per scanned drive, mm.
    displacements: Vec<Vec<[f64; 3]>>,
    /// Forces at the scans, then those on the way, N.
    forces_n: Vec<f64>,
}

impl MeshDefect {
    /// `data` as the fitting mesh would have shown them.
    pub(super) fn taken_off(&self, data: &Measurement) -> Measurement {
        let mut corrected = data.clone();
        for (field, defect) in corrected.displacements.iter_mut().zip(&self.displacements) {
            for (u, d) in field.iter_mut().zip(defect) {
                for c in 0..3 {
                    u[c] -= d[c];
                }
            }
        }
        let on_the_way = corrected.on_the_way.iter_mut().map(|r| &mut r.force.value_n);
        for (force, defect) in corrected.forces_n.iter_mut().chain(on_the_way).zip(&self.forces_n) {
            *force -= defect;
        }
        corrected
    }
}

/// A specimen's samples on a finer mesh, and how the scan sees them.
pub(super) struct FinerMesh {
    bench: Bench,
}

impl FinerMesh {
    /// Of the specimen that `synthetic` is a scan of.
    ///
    /// # Errors
    /// [`CalibrationError`]: the specimen cannot be meshed so.
    pub(super) fn new(
        specimen: &Specimen,
        mesh: &MeshOptions,
        synthetic: &SyntheticScan,
    ) -> Result<FinerMesh, CalibrationError> {
        Ok(FinerMesh { bench: Bench::of_specimen(specimen, mesh, &synthetic.masks())? })
    }

    /// What this mesh predicts of a fitted material beyond what the fitting mesh does at the drives of `data`.
    fn defect(
        &mut self,
        ours: &Fit,
        data: &Measurement,
        (solve, is_cancelled): (&SolveOptions, &(dyn Fn() -> bool + Sync)),
    ) -> Result<MeshDefect, CalibrationError> {
        let mut defect = MeshDefect { displacements: Vec::new(), forces_n: Vec::new() };
        for (n, drive_mm) in data.all_drives_mm().into_iter().enumerate() {
            let (fine, force_n) = self.bench.scan(&ours.material, drive_mm, solve, is_cancelled)?;
            defect.forces_n.push(force_n - ours.forces_n[n]);
            if n < data.drives_mm.len() {
                let own = &ours.displacements[n];
                let apart = fine.iter().zip(own).map(|(f, o)| [0, 1, 2].map(|c| f[c] - o[c])).collect();
                defect.displacements.push(apart);
            }
        }
        Ok(defect)
    }

    /// The fit to `data` without noise, corrected by this mesh, and the correction that the data of every draw need;
    /// `first` is the fit without it.
    ///
    /// # Errors
    /// [`CalibrationError`]: the finer mesh has no equilibrium, a corrected fit failed, or the work was cancelled.
    pub(super) fn correct(
        &mut self,
        start: &FitStart,
        bench: &mut Bench,
        synthetic: &SyntheticScan,
        first: &Fit,
        (solve, is_cancelled): (&SolveOptions, &(dyn Fn() -> bool + Sync)),
    ) -> Result<(MeshDefect, Fit), CalibrationError> {
        let data = synthetic.noiseless();
        let mut corrected = None;
        let mut at = first.clone();
        for _ in 0..PASSES {
            let defect = self.defect(&at, data, (solve, is_cancelled))?;
            at = start.fit(bench, &synthetic.scan, &defect.taken_off(data), is_cancelled)?;
            corrected = Some((defect, at.clone()));
        }
        corrected.ok_or(CalibrationError::InvalidValue {
            name: "the number of passes",
            value: 0.0,
            requirement: "positive",
        })
    }
}
