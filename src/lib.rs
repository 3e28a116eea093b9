//! lambdak designs the specimen from which one full-field (MR-u) scan tells the most about a soft material.
//!
//! The command `lambdak` does most of it; the library does the same and more. The module `prelude` holds what short
//! programs need:
//!
//! ```
//! use lambdak::prelude::*;
//!
//! let specimen = Specimen::from_json(&std::fs::read_to_string("geometries/solid-shear.json")?)?;
//! let material = Material::new(2173.0, [(17.0, 1.91)])?;
//! let mut model = ForwardModel::of_specimen(&specimen, &MeshOptions::search(&specimen))?;
//! let state = model.solve(&material, 2.5, None, &SolveOptions::default(), &|| false)?;
//!
//! // Two samples in simple shear would take 2 G γ A with G = μα/2; the free ends take off a few per cent.
//! let block = &specimen.block;
//! let simple_shear = 2.0 * 0.5 * 17.0e-3 * 1.91 * 2.5 / block.thickness_mm * block.length_mm * block.width_mm;
//! assert!(state.force_n > 0.9 * simple_shear && state.force_n < simple_shear);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! More programs are in `examples/`; docs/library.md tells how to depend on the library and what its features are.
//!
//! The rooms stand on one another in this order; a room uses only those before it:
//! [`field`], [`file`](mod@file), [`provenance`], [`optimise`] → [`specimen`] → [`mesh`], [`material`] → [`fem`] →
//! [`kinematics`], [`homogeneous`], [`rate`], [`voxel`] → [`sensitivity`] → [`recording`], [`acquisition`] →
//! [`calibration`] → [`diagnosis`], [`design`] → [`next`] → [`proof`] → [`sweep`] → [`slurm`], [`report`],
//! [`export`] → [`compare`] → [`job`] → [`service`] → [`cli`].
//!
//! One unit system inside: lengths mm, moduli and stresses kPa, times s. Stress × area is then
//! kPa·mm² = 10⁻³ N; forces cross every public boundary in N.

#[cfg(feature = "calibration")]
pub mod acquisition;
#[cfg(feature = "calibration")]
pub mod calibration;
#[cfg(feature = "cli")]
pub mod cli;
#[cfg(feature = "design")]
pub mod compare;
#[cfg(feature = "design")]
pub mod design;
#[cfg(feature = "calibration")]
pub mod diagnosis;
#[cfg(feature = "design")]
pub mod export;
pub mod fem;
pub mod field;
pub mod file;
pub mod homogeneous;
#[cfg(feature = "jobs")]
pub mod job;
pub mod kinematics;
pub mod material;
pub mod mesh;
#[cfg(feature = "design")]
pub mod next;
pub mod optimise;
#[cfg(feature = "design")]
pub mod proof;
pub mod provenance;
pub mod rate;
#[cfg(feature = "calibration")]
pub mod recording;
#[cfg(feature = "design")]
pub mod report;
pub mod sensitivity;
#[cfg(feature = "service")]
pub mod service;
#[cfg(feature = "design")]
pub mod slurm;
pub mod specimen;
#[cfg(feature = "design")]
pub mod sweep;
pub mod voxel;

/// What short programs need: `use lambdak::prelude::*`.
pub mod prelude {
    #[cfg(feature = "calibration")]
    pub use crate::calibration::{CalibrateOptions, Observed, TermCount, calibrate};
    #[cfg(feature = "calibration")]
    pub use crate::diagnosis::{
        Category, Cause, CauseName, CauseParameter, DiagnosisOptions, DiagnosisResult, Laboratory, Registry, Scene,
        diagnose, diagnose_with,
    };
    pub use crate::fem::{Equilibrium, Field, ForwardModel, SolveOptions};
    pub use crate::material::{Material, OgdenTerm, Parameter};
    pub use crate::mesh::{MeshOptions, MeshSize};
    #[cfg(feature = "calibration")]
    pub use crate::recording::{Filter, RecordedStep, Recording};
    pub use crate::sensitivity::{DriveSelection, EvaluationOptions, PartialVoxels, ScanSettings, evaluate};
    pub use crate::specimen::Specimen;
    pub use crate::voxel::{Sampling, VoxelGrid, VoxelMask, VoxelOperator};
}
