//! Diagnosis: where a recording and its nominal model differ, and what physics was left out.

pub mod causes;
mod error;
mod fit;
mod laboratory;
mod maps;
mod metric;
mod scene;
mod score;
mod trace;

pub use error::DiagnosisError;
#[cfg(test)]
mod explore;
