//! lambdak designs the specimen from which one full-field (MR-u) scan tells the most about a soft material.
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
