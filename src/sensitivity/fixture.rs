//! The samples of one test, meshed, and those of them that are scanned in their scanner.

use super::error::EvaluationError;
use super::evaluation_options::EvaluationOptions;
use super::observation::Scanner;
use super::scan_settings::ScanSettings;
use crate::fem::{Equilibrium, ForwardModel, PrepareError, SolveError, SolveOptions};
use crate::material::Material;
use crate::specimen::Specimen;

/// A specimen's samples. All share the drive and the load cell, whose force is the sum of theirs; each that is scanned
/// has voxels of its own.
pub struct Fixture {
    specimen: Specimen,
    scan: ScanSettings,
    parts: Vec<Part>,
}

/// One kind of sample.
pub struct Part {
    /// The sample alone.
    pub specimen: Specimen,
    /// Its model; forces are those of all samples of the kind.
    pub model: ForwardModel,
    /// How many of the kind are scanned.
    pub num_scanned: u32,
    /// How the scan sees one of them; `None` where none is scanned.
    pub scanner: Option<Scanner>,
}

impl Fixture {
    /// Meshes every sample of `specimen` and puts those that `options.protocol` names into the scanner.
    ///
    /// # Errors
    /// [`EvaluationError`]: a sample cannot be meshed, or does not suit scan or protocol.
    pub fn new(
        specimen: &Specimen,
        scan: &ScanSettings,
        options: &EvaluationOptions,
    ) -> Result<Fixture, EvaluationError> {
        let prepared = |sample: &Specimen| {
            let mesh = options.mesh.carried(specimen, sample);
            ForwardModel::of_specimen(sample, &mesh).map_err(|error| match error {
                PrepareError::Mesh(error) => EvaluationError::from(error),
                PrepareError::Solve(error) => EvaluationError::from(error),
            })
        };
        let models = specimen.samples().iter().map(prepared).collect::<Result<Vec<_>, _>>()?;
        Fixture::of_models(specimen, models, scan, options)
    }

    /// As [`Self::new`], of one model for each of [`Specimen::samples`], in their order.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn of_models(
        specimen: &Specimen,
        models: Vec<ForwardModel>,
        scan: &ScanSettings,
        options: &EvaluationOptions,
    ) -> Result<Fixture, EvaluationError> {
        let counts = specimen.num_scanned(options.protocol.blocks_scanned);
        let mut parts = Vec::with_capacity(models.len());
        for ((sample, model), num_scanned) in specimen.samples().into_iter().zip(models).zip(counts) {
            let scanner =
                if num_scanned > 0 { Some(Scanner::new(&sample, model.mesh(), scan, options.sampling)?) } else { None };
            parts.push(Part { specimen: sample, model, num_scanned, scanner });
        }
        Ok(Fixture { specimen: specimen.clone(), scan: *scan, parts })
    }

    /// The specimen.
    pub fn specimen(&self) -> &Specimen {
        &self.specimen
    }

    /// The scan.
    pub fn scan(&self) -> &ScanSettings {
        &self.scan
    }

    /// The kinds of samples, in the order of [`Specimen::samples`].
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// The same, to be solved.
    pub fn parts_mut(&mut self) -> &mut [Part] {
        &mut self.parts
    }

    /// Equilibria at some drives, of each part: each from a neighbour at its drive where there is one that leads there,
    /// else from the last. `neighbours` are of each part too, of another material.
    ///
    /// # Errors
    /// As [`ForwardModel::solve`].
    pub fn solve_path(
        &mut self,
        material: &Material,
        drives_mm: &[f64],
        neighbours: &[Vec<Equilibrium>],
        options: &SolveOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Vec<Vec<Equilibrium>>, SolveError> {
        let mut all = Vec::with_capacity(self.parts.len());
        for (index, part) in self.parts.iter_mut().enumerate() {
            let neighbours = neighbours.get(index).map_or(&[][..], |n| &n[..]);
            let mut path: Vec<Equilibrium> = Vec::with_capacity(drives_mm.len());
            for &drive in drives_mm {
                let beside = neighbours.iter().find(|n| n.drive_mm == drive);
                let found =
                    beside.and_then(|start| part.model.solve(material, drive, Some(start), options, is_cancelled).ok());
                path.push(match found {
                    Some(found) => found,
                    None => part.model.solve(material, drive, path.last(), options, is_cancelled)?,
                });
            }
            all.push(path);
        }
        Ok(all)
    }
}
