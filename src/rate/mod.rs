//! Time-dependent response: relaxation of elastic histories and what explains a load curve.

mod prony;
mod table;

pub use prony::{HistoryError, PronyTerm, RelaxedHistory, relax};
pub use table::{ForceTable, TableError};
