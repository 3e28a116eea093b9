//! What a whole calibration found.

use super::allowance::Allowance;
use super::contours::Contour;
use super::prediction::SolverWork;
use super::profile::Profile;
use super::recording_fit::RecordingFit;
use super::terms::TermSelection;
use crate::material::{Material, Parameter};

/// One parameter of a [`Calibration`].
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Which.
    pub parameter: Parameter,
    /// Its value in the fitted material.
    pub value: f64,
    /// Standard deviation; none where the data do not determine it.
    pub sd: Option<f64>,
    /// What our own mesh may have shifted it by.
    pub mesh_error: f64,
    /// Standard deviation from discretisation errors, the data's included; of ln κ times κ for κ.
    pub discretisation_sd: f64,
    /// What the structured part of the misfit may have shifted it by, at most.
    pub possible_shift: f64,
    /// 95 % interval; a side that the data leave open is none. κ's is symmetric in ln κ; where terms are hardly told
    /// apart, those of moduli and exponents are of their profile likelihoods.
    pub interval_95: [Option<f64>; 2],
    /// Whether the standard deviation is below half of the value.
    pub is_identifiable: bool,
}

/// Estimates of two meshes.
#[derive(Clone, Debug)]
pub struct MeshComparison {
    /// Free unknowns of the coarser and the finer models, all recordings together.
    pub num_unknowns: [usize; 2],
    /// The material on the coarser mesh.
    pub coarse: Material,
    /// What is allowed for discretisation errors.
    pub allowance: Allowance,
}

/// What a calibration found.
#[derive(Debug)]
pub struct Calibration {
    /// The estimate, on the finer mesh, terms in the order of falling exponents.
    pub fit: RecordingFit,
    /// κ, μ₁, α₁, …
    pub estimates: Vec<Estimate>,
    /// ½ Σμα, kPa, with its interval; none without a force.
    pub initial_shear_modulus: Option<(f64, Option<[f64; 2]>)>,
    /// Term selection.
    pub selection: TermSelection,
    /// The two meshes; none where only one was used.
    pub meshes: Option<MeshComparison>,
    /// On request.
    pub profiles: Vec<Profile>,
    /// On request.
    pub contours: Vec<Contour>,
    /// The principal stretch that 99 of 100 voxels stay below, all recordings and drives together.
    pub largest_stretch: f64,
    /// Whether any force was given.
    pub has_force: bool,
    /// All fits together.
    pub work: SolverWork,
    /// Remarks for the reader.
    pub notes: Vec<String>,
}
