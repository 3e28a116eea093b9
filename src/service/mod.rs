//! The live door: REST, jobs, storage, workers and a page for planners. Nothing numerical lives here.
//!
//! ```text
//! request ─► app (identity, limits, log) ─► routes ─► job (checked) ─► store (queue)
//!                                                                     │ claim, lease, heartbeat
//! page ◄─ events ◄─ hub ◄─ store ◄─ result, artefacts ◄─ job (run) ◄─ runner (own threads)
//! ```
//!
//! * [`store`]: SQLite or PostgreSQL; exactly one result per task, equal evaluations computed once.
//! * kinds of jobs, their requests and outcomes are those of [`crate::job`]; they are only handed on here.
//! * [`runner`]: slots on own threads, so that readers are never blocked by numerics.
//! * `routes`: the addresses with their OpenAPI 3.1 document.

pub mod access;
mod answer;
pub mod app;
mod body;
mod foreign;
mod hub;
pub mod limits;
mod log;
mod metrics;
mod open_files;
mod paced;
pub mod problem;
mod quota;
mod recordings;
mod router;
mod routes;
pub mod runner;
mod server;
mod signal;
pub mod store;
mod surroundings;
mod tar;
mod task;
mod turns;
mod view;

pub use routes::open_api;
pub use server::{ServeError, ServeOptions, WorkerOptions, serve, work};
pub use view::{ArtefactList, ArtefactView, JobList, JobState, JobView};
