//! lambdak designs the specimen from which one full-field (MR-u) scan tells the most about a soft material.
//!
//! The command `lambdak` does most of it; the library does the same and more. The module `prelude` holds what short
//! programs need:
//!
//! ```
//! use lambdak::prelude::*;
//!
//! let specimen = Specimen::from_json(&std::fs::read_to_string("geometries/solid-shear.json")?)?;
//! let material = Ogden::new(2173.0, [(17.0, 1.91)])?;
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
//! More programs are in `examples/`.
//!
//! The rooms stand on one another in this order; a room uses only those before it:
//! [`field`], [`file`](mod@file), [`provenance`], [`optimise`] → [`specimen`] → [`mesh`], [`material`] → [`fem`] →
//! [`kinematics`], [`homogeneous`], [`rate`], [`voxel`] → [`sensitivity`] → [`recording`], [`acquisition`] →
//! [`calibration`] → [`diagnosis`], [`design`] → [`proof`] → [`sweep`] → [`slurm`], [`report`], [`export`] →
//! [`compare`] → [`job`] → [`service`] → [`cli`].
//!
//! One unit system inside: lengths mm, moduli and stresses kPa, times s. Stress × area is then
//! kPa·mm² = 10⁻³ N; forces cross every public boundary in N.

pub mod acquisition;
pub mod calibration;
pub mod cli;
pub mod compare;
pub mod design;
pub mod diagnosis;
pub mod export;
pub mod fem;
pub mod field;
pub mod file;
pub mod homogeneous;
pub mod job;
pub mod kinematics;
pub mod material;
pub mod mesh;
pub mod optimise;
pub mod proof;
pub mod provenance;
pub mod rate;
pub mod recording;
pub mod report;
pub mod sensitivity;
pub mod service;
pub mod slurm;
pub mod specimen;
pub mod sweep;
pub mod voxel;

/// What short programs need: `use lambdak::prelude::*`.
pub mod prelude {
    pub use crate::calibration::{CalibrateOptions, Observed, TermCount, calibrate};
    pub use crate::fem::{Equilibrium, ForwardModel, SolveOptions};
    pub use crate::material::{Ogden, OgdenTerm, Parameter};
    pub use crate::mesh::{MeshOptions, MeshSize};
    pub use crate::recording::{Filter, RecordedStep, Recording};
    pub use crate::sensitivity::{DriveSelection, EvaluationOptions, PartialVoxels, ScanSettings, evaluate};
    pub use crate::specimen::Specimen;
    pub use crate::voxel::{Sampling, VoxelGrid, VoxelMask, VoxelOperator};
}
