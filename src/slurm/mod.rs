//! Job arrays on a Slurm cluster through the installed `sbatch`, `squeue`, `sacct`, `scontrol` and `scancel`.
//!
//! An array's tasks leave their results in files that this machine sees too (a shared folder). Those files alone say
//! whether a task is finished; the scheduler is only asked whether it is still at it. A task that the scheduler has
//! lost (a dead node, a time limit, a crash) is requeued, or submitted again where the controller has forgotten it.

mod array;
mod commands;
mod error;
mod follow;

pub use array::{ArrayJob, Resources};
pub use commands::{Scheduler, TaskState};
pub use error::SlurmError;
pub use follow::{FollowSettings, Following, TaskProgress, follow};
