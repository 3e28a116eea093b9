//! Time-dependent response: relaxation of elastic histories and what explains a load curve.
//!
//! * [`relax`]: the Prony convolution of an elastic history, with derivatives.
//! * [`fit_force_history`]: relaxations in the force history of one specimen whose elastic force is a [`ForceTable`].
//! * [`analyse_load_curve`]: load curves of homogeneous tests: what an elastic material leaves out, what explains it,
//!   and whether the explanation predicts what was kept back.

mod analysis;
mod analysis_options;
mod channels;
mod force_history;
mod force_history_input;
mod force_history_result;
mod load_curve;
mod load_fit;
mod model;
mod prony;
mod search;
mod starts;
mod summary;
mod verdict;

pub use crate::homogeneous::{ForceTable, TableError};
pub use analysis::analyse_load_curve;
pub use analysis_options::{
    AMBIGUOUS_BIC, EXPLAINED_PART, F_TEST_LEVEL, LoadCurveAnalysisError, LoadCurveOptions, MIN_DELTA_BIC,
};
#[cfg(test)]
pub(crate) use channels::channels;
pub use force_history::fit_force_history;
pub use force_history_input::{ForceHistory, ForceHistoryError, ForceHistoryOptions, ShearLayer};
pub use force_history_result::{FittedRelaxation, ForceHistoryFit, ForceHistorySequence};
pub use load_curve::{LoadCurve, LoadCurveError};
#[cfg(feature = "calibration")]
pub(crate) use prony::memory;
pub use prony::{HistoryError, PronyTerm, RelaxedHistory, relax};
pub use verdict::{
    BeforeAfter, CauseParameter, CurveCause, CurveMaterial, CurveTrace, Hypothesis, HypothesisEvidence,
    LoadCurveVerdict, MatchBeforeAfter, Verdict,
};
