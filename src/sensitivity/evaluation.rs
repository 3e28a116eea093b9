//! Evaluates a specimen: what a scan of it would see and what it would tell about the material.

use super::continuum::largest_principal_stretch;
use super::covariance::{IDENTIFIABILITY_LIMIT, PromisedSd};
use super::drives::{DriveSelection, check_drives, solve_for_median};
use super::error::EvaluationError;
use super::information::FisherInformation;
use super::joint_information::JointInformation;
use super::observation::{DriveMaps, DrivenState, EvaluationStep, Scanner, Unknown};
use super::protocol::{Nuisance, Protocol, SAME_DRIVE_MM};
use super::scan_settings::ScanSettings;
use crate::fem::{Equilibrium, ForwardModel, PrepareError, SolveError, SolveOptions, Tangent};
use crate::material::{Ogden, Parameter};
use crate::mesh::MeshOptions;
use crate::provenance::input_hash;
use crate::specimen::Specimen;
use crate::voxel::{Sampling, VoxelMask};
use serde::{Deserialize, Serialize};

/// Settings of an evaluation.
#[derive(Clone, Debug)]
pub struct EvaluationOptions {
    /// The mesh.
    pub mesh: MeshOptions,
    /// Sample points per voxel.
    pub sampling: Sampling,
    /// The solver.
    pub solve: SolveOptions,
    /// Largest relative standard deviation of an identifiable parameter.
    pub identifiability_limit: f64,
    /// Standard deviation of ln κ known beforehand, added to the joint information; none by default.
    pub bulk_log_prior_sd: Option<f64>,
    /// Forces read beside the scans, and what is not known exactly of the set-up; none by default.
    pub protocol: Protocol,
}

impl EvaluationOptions {
    /// Standard mesh, default sampling and tolerances, no prior.
    pub fn standard(specimen: &Specimen) -> Self {
        EvaluationOptions {
            mesh: MeshOptions::standard(specimen),
            sampling: Sampling::default(),
            solve: SolveOptions::default(),
            identifiability_limit: IDENTIFIABILITY_LIMIT,
            bulk_log_prior_sd: None,
            protocol: Protocol::default(),
        }
    }
}

/// Result of an evaluation (`evaluation/1`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Evaluation {
    /// Always `evaluation/1`.
    pub schema: String,
    /// Drives that are scanned, increasing.
    pub steps: Vec<EvaluationStep>,
    /// Drives at which the force alone is read.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub force_steps: Vec<ForceStep>,
    /// Standard deviations that all drives together promise.
    pub promised_sd: Vec<PromisedSd>,
    /// Correlation of the estimates, rows and columns as `promised_sd`; null where undetermined.
    pub correlation: Vec<Vec<Option<f64>>>,
    /// Largest over smallest eigenvalue of the relative covariance of all μᵢ, αᵢ; null where undetermined.
    pub condition_number: Option<f64>,
    /// Largest principal stretch at any drive.
    pub largest_principal_stretch: f64,
    /// Material volume of the mask, mm³.
    pub voxel_material_volume_mm3: f64,
    /// The scan.
    pub scan: ScanSettings,
    /// What the numbers mean.
    pub notes: EvaluationNotes,
    /// Sizes of the computation.
    pub statistics: EvaluationStatistics,
    /// Version of the program.
    pub version: String,
    /// SHA-256 of specimen, material, scan, drives and settings, hexadecimal.
    pub input_hash: String,
}

/// A drive at which the force alone is read.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForceStep {
    /// Drive, mm.
    pub drive_mm: f64,
    /// Force of all samples together, N.
    pub force_n: f64,
}

/// Meaning of the numbers, for readers of the JSON alone.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvaluationNotes {
    /// `integrated_sensitivity`.
    pub integrated_sensitivity: String,
    /// `promised_sd`.
    pub promised_sd: String,
}

impl Default for EvaluationNotes {
    fn default() -> Self {
        EvaluationNotes {
            integrated_sensitivity: "sum: over voxels of d2Psi/dxi dlambda at the voxel's (lambda, k), 1 for mu and kPa for alpha; \
                                     mean_per_voxel: sum / num_voxels; volume_integral: sum weighted by the voxel's material \
                                     volume (mm3), comparable across voxel sizes; kappa's is zero"
                .into(),
            promised_sd: "Cramer-Rao bound of a joint fit of all parameters to the voxel displacements and forces; at the top level from \
                          all drives together, in a step from that drive alone; value in the parameter's unit, null where the \
                          data do not determine it"
                .into(),
        }
    }
}

/// Sizes of the computation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvaluationStatistics {
    /// Elements of the mesh.
    pub num_elements: usize,
    /// Nodes of the mesh.
    pub num_nodes: usize,
    /// Free displacement unknowns.
    pub num_unknowns: usize,
    /// Equilibria solved for (more than steps when a drive was searched).
    pub num_equilibria: usize,
    /// Sample points of the voxels.
    pub num_sample_points: usize,
    /// Sample points dropped between wall and mesh.
    pub num_dropped_points: usize,
}

/// What an evaluation holds besides its numbers: for plots and further work.
#[derive(Clone, Debug)]
pub struct EvaluationMaps {
    /// Grid and mask.
    pub mask: VoxelMask,
    /// Voxel fields per drive.
    pub drives: Vec<DriveMaps>,
    /// Equilibria per drive, on the model's mesh.
    pub equilibria: Vec<Equilibrium>,
    /// Information of all drives together, with the prior if any.
    pub information: FisherInformation,
    /// Information of each drive.
    pub information_by_drive: Vec<FisherInformation>,
}

/// Meshes, solves and evaluates a specimen.
///
/// # Errors
/// See [`EvaluationError`].
pub fn evaluate(
    specimen: &Specimen,
    material: &Ogden,
    scan: &ScanSettings,
    drives: &DriveSelection,
    options: &EvaluationOptions,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<(Evaluation, EvaluationMaps), EvaluationError> {
    check_drives(drives)?;
    let mut model = ForwardModel::of_specimen(specimen, &options.mesh).map_err(|error| match error {
        PrepareError::Mesh(error) => EvaluationError::from(error),
        PrepareError::Solve(error) => EvaluationError::from(error),
    })?;
    evaluate_model(&mut model, specimen, material, scan, drives, options, is_cancelled)
}

/// As [`evaluate`] on a prepared model of `specimen`; `options.mesh` only enters the input hash.
///
/// # Errors
/// See [`EvaluationError`].
pub fn evaluate_model(
    model: &mut ForwardModel,
    specimen: &Specimen,
    material: &Ogden,
    scan: &ScanSettings,
    drives: &DriveSelection,
    options: &EvaluationOptions,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<(Evaluation, EvaluationMaps), EvaluationError> {
    check_drives(drives)?;
    let scanner = Scanner::new(specimen, model.mesh(), scan, options.sampling)?;
    let scanned = Scanned { specimen, scan, scanner: &scanner, neighbours: &[] };
    evaluate_scanned(model, &scanned, material, drives, options, is_cancelled)
}

/// A specimen in the scanner: what is the same for every material that it may be made of.
#[derive(Clone, Copy, Debug)]
pub struct Scanned<'a> {
    /// The specimen.
    pub specimen: &'a Specimen,
    /// The scan.
    pub scan: &'a ScanSettings,
    /// The scan of the specimen on the model's mesh.
    pub scanner: &'a Scanner,
    /// Equilibria of the model with another material: where one is at a drive asked for, its solution starts there.
    pub neighbours: &'a [Equilibrium],
}

/// As [`evaluate_model`], where the scanner is prepared too.
///
/// # Errors
/// See [`EvaluationError`].
pub fn evaluate_scanned(
    model: &mut ForwardModel,
    &Scanned { specimen, scan, scanner, neighbours }: &Scanned,
    material: &Ogden,
    drives: &DriveSelection,
    options: &EvaluationOptions,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<(Evaluation, EvaluationMaps), EvaluationError> {
    check_drives(drives)?;
    let (equilibria, num_equilibria) = match drives {
        DriveSelection::DriveMm(drives_mm) => {
            let path = solve_beside(model, material, drives_mm, neighbours, (&options.solve, is_cancelled))?;
            let count = path.len();
            (path, count)
        }
        DriveSelection::MedianStretch(target) => {
            let (found, count) =
                solve_for_median(model, specimen, material, scanner, *target, &options.solve, is_cancelled)?;
            (vec![found], count)
        }
    };
    let nuisances = options.protocol.nuisances();
    let mut joint = JointInformation::none(material, nuisances.len());
    let (mut steps, mut maps, mut information_by_drive) = (Vec::new(), Vec::new(), Vec::new());
    for equilibrium in &equilibria {
        let stretch = largest_principal_stretch(&model.quadrature_fields(material, equilibrium));
        let mut tangent = model.tangent(material, equilibrium)?;
        let sensitivities = tangent.material_sensitivities()?;
        let state = DrivenState {
            drive_mm: equilibrium.drive_mm,
            force_n: equilibrium.force_n,
            displacement: &equilibrium.displacement,
            sensitivities: &sensitivities,
            largest_principal_stretch: stretch,
            unknowns: &unknowns_at(&nuisances, equilibrium, &mut tangent)?,
        };
        let seen = scanner.observe(material, &state, options.identifiability_limit)?;
        joint.add(&seen.joint)?;
        information_by_drive.push(seen.information);
        steps.push(seen.step);
        maps.push(seen.maps);
    }
    let force_steps = add_forces(&mut joint, model, material, scan, options, &steps, is_cancelled)?;
    let sd: Vec<f64> = nuisances.iter().map(|n| n.1).collect();
    let mut information = joint.about_material(material, &sd)?;
    if let Some(sd) = options.bulk_log_prior_sd {
        information.add_log_prior(Parameter::Kappa, sd)?;
    }
    let covariance = information.covariance();
    let evaluation = Evaluation {
        schema: "evaluation/1".into(),
        promised_sd: covariance.promised_sd(options.identifiability_limit),
        correlation: covariance.correlation_matrix(),
        condition_number: covariance.condition_number(&information.shear_indices()),
        largest_principal_stretch: steps.iter().map(|s| s.largest_principal_stretch).fold(f64::NAN, f64::max),
        steps,
        force_steps,
        voxel_material_volume_mm3: scanner.mask.material_volume_mm3(),
        scan: *scan,
        notes: EvaluationNotes::default(),
        statistics: EvaluationStatistics {
            num_elements: model.mesh().num_elements(),
            num_nodes: model.mesh().nodes.len(),
            num_unknowns: model.num_unknowns(),
            num_equilibria,
            num_sample_points: scanner.operator.num_points(),
            num_dropped_points: scanner.operator.num_dropped_points(),
        },
        version: env!("CARGO_PKG_VERSION").into(),
        input_hash: hash_of_inputs(specimen, material, scan, drives, options),
    };
    Ok((
        evaluation,
        EvaluationMaps { mask: scanner.mask.clone(), drives: maps, equilibria, information, information_by_drive },
    ))
}

/// Equilibria at some drives, each from a neighbour at its drive where there is one and that leads there, else from the
/// last.
fn solve_beside(
    model: &mut ForwardModel,
    material: &Ogden,
    drives_mm: &[f64],
    neighbours: &[Equilibrium],
    (options, is_cancelled): (&SolveOptions, &dyn Fn() -> bool),
) -> Result<Vec<Equilibrium>, SolveError> {
    let mut path: Vec<Equilibrium> = Vec::with_capacity(drives_mm.len());
    for &drive in drives_mm {
        let beside = neighbours.iter().find(|n| n.drive_mm == drive);
        let found = beside.and_then(|start| model.solve(material, drive, Some(start), options, is_cancelled).ok());
        path.push(match found {
            Some(found) => found,
            None => model.solve(material, drive, path.last(), options, is_cancelled)?,
        });
    }
    Ok(path)
}

/// How the state of a drive changes with each unknown of the set-up.
fn unknowns_at(
    nuisances: &[(Nuisance, f64)],
    equilibrium: &Equilibrium,
    tangent: &mut Tangent,
) -> Result<Vec<Unknown>, EvaluationError> {
    let of = |&(nuisance, sd): &(Nuisance, f64)| {
        let (displacement, force_n) = match nuisance {
            Nuisance::ForceGain => (None, equilibrium.force_n),
            Nuisance::ForceZero => (None, 1.0),
            Nuisance::DriveZero => {
                let along = tangent.path_sensitivity(&[], None, 1.0)?;
                (Some(along.displacement), along.force_n)
            }
        };
        Ok(Unknown { sd, displacement, force_n })
    };
    nuisances.iter().map(of).collect()
}

/// Adds the forces that are read without a scan, and gives them. A drive that is scanned has its force already.
fn add_forces(
    joint: &mut JointInformation,
    model: &mut ForwardModel,
    material: &Ogden,
    scan: &ScanSettings,
    options: &EvaluationOptions,
    scanned: &[EvaluationStep],
    is_cancelled: &dyn Fn() -> bool,
) -> Result<Vec<ForceStep>, EvaluationError> {
    let is_scanned = |drive: &f64| scanned.iter().any(|s| (s.drive_mm - drive).abs() < SAME_DRIVE_MM);
    let mut drives = options.protocol.force_drives_mm();
    drives.retain(|d| !is_scanned(d));
    if drives.is_empty() {
        return Ok(Vec::new());
    }
    check_drives(&DriveSelection::DriveMm(drives.clone()))?;
    let nuisances = options.protocol.nuisances();
    let mut steps = Vec::new();
    for equilibrium in model.solve_path(material, &drives, &options.solve, is_cancelled)? {
        let mut tangent = model.tangent(material, &equilibrium)?;
        let forces: Vec<f64> = tangent.material_sensitivities()?.iter().map(|s| s.force_n).collect();
        let unknowns = unknowns_at(&nuisances, &equilibrium, &mut tangent)?;
        let of_unknowns: Vec<f64> = unknowns.iter().map(|u| u.force_n).collect();
        joint.add_force(&forces, &of_unknowns, scan.force_sd_n);
        steps.push(ForceStep { drive_mm: equilibrium.drive_mm, force_n: equilibrium.force_n });
    }
    Ok(steps)
}

/// SHA-256 over the JSON of all inputs. Field order is fixed by the types, so equal inputs have equal hashes.
fn hash_of_inputs(
    specimen: &Specimen,
    material: &Ogden,
    scan: &ScanSettings,
    drives: &DriveSelection,
    options: &EvaluationOptions,
) -> String {
    let Sampling { gauss_points, cut_slices } = options.sampling;
    let mut inputs = serde_json::json!({
        "specimen": specimen,
        "material": material,
        "scan": scan,
        "drives": drives,
        "mesh": options.mesh,
        "sampling": { "gauss_points": gauss_points, "cut_slices": cut_slices },
        "solver_tolerance": options.solve.tolerance,
        "identifiability_limit": options.identifiability_limit,
        "bulk_log_prior_sd": options.bulk_log_prior_sd,
    });
    // Left out where there is nothing beside the scans, so that older results can be compared.
    if options.protocol != Protocol::default() {
        inputs["protocol"] = serde_json::json!(options.protocol);
    }
    input_hash(&inputs)
}

#[cfg(test)]
mod tests;
