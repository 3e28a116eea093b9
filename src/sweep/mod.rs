//! Batch sweeps: many designs evaluated, one typed result each, on one machine or many.
//!
//! A study (`sweep-study/1`) is a base specimen, named variables with their sampling, materials, a scan and a mesh. A
//! task is one design with one material. Every finished task is one checksummed line of a shard's file; the table is a
//! pure function of the set of results in the order of the tasks, so that a killed and resumed sweep, shards, a cluster
//! and an undisturbed run give the same bytes.

mod column_names;
mod error;
#[cfg(feature = "parquet")]
mod parquet;
mod points;
mod result;
mod run;
mod shard;
mod store;
mod study;
mod study_check;
mod study_error;
mod study_file;
mod table;
mod target;
mod task;

pub use error::{StoreError, SweepError};
#[cfg(feature = "parquet")]
pub use parquet::to_parquet;
pub use points::latin_hypercube_points;
pub use result::{SweepCell, SweepResult};
pub use run::{Observe, RunOptions, SweepProgress, SweepRun, run};
pub use shard::Shard;
pub use store::{Collected, ShardContents, ShardWriter, collect, read_shard, shard_path};
pub use study::{NamedMaterial, SampleRange, Sampling, SweepStudy, SweepVariable};
pub use study_error::SweepStudyError;
pub use table::{Cells, SweepTable, TableColumn};
pub use target::Target;
pub use task::{Figures, Outcome, Task, TaskInputs, tasks};
