//! The live door: REST, jobs, storage, workers and a page for planners. Nothing numerical lives here.
//!
//! ```text
//! request ─► app (identity, limits, log) ─► routes ─► kinds::plan ─► store (queue)
//!                                                                     │ claim, lease, heartbeat
//! page ◄─ events ◄─ hub ◄─ store ◄─ result, artefacts ◄─ kinds::run ◄─ runner (own threads)
//! ```
//!
//! * [`store`]: SQLite or PostgreSQL; exactly one result per task, equal evaluations computed once.
//! * [`kinds`]: one file per kind of job: validate, run the library call, say what it leaves.
//! * [`runner`]: slots on own threads, so that readers are never blocked by numerics.
//! * `routes`: the addresses with their OpenAPI 3.1 document.

pub mod access;
pub mod app;
mod hub;
pub mod kinds;
mod log;
mod metrics;
pub mod problem;
mod recordings;
mod routes;
pub mod runner;
mod server;
pub mod store;
mod surface;
mod view;

pub use routes::open_api;
pub use server::{ServeError, ServeOptions, WorkerOptions, serve, work};
pub use view::{ArtefactList, ArtefactView, JobList, JobState, JobView};
