//! Time-dependent response: relaxation of elastic histories and what explains a load curve.
//!
//! * [`relax`]: the Prony convolution of an elastic history, with derivatives.
//! * [`fit_force_history`]: relaxations in the force history of one specimen whose elastic force is a [`ForceTable`].

mod channels;
mod force_history;
mod load_curve;
mod model;
mod prony;
mod starts;
mod table;

pub use force_history::{
    FittedRelaxation, ForceHistory, ForceHistoryError, ForceHistoryFit, ForceHistoryOptions, ForceHistorySequence,
    fit_force_history,
};
pub use load_curve::{LoadCurve, LoadCurveError};
pub use prony::{HistoryError, PronyTerm, RelaxedHistory, relax};
pub use table::{ForceTable, TableError};
