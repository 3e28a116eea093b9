//! What a program says of a recording: the part of a diagnosis that is scored.

use crate::diagnosis::{BeforeAfter, DiagnosisResult, Location, ParameterResult, Verdict};
use serde::{Deserialize, Serialize};

/// An answer. Further fields of its JSON are not read, so that a `diagnosis/1` is one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// How the diagnosis ended.
    pub verdict: Verdict,
    /// Causes named.
    #[serde(default)]
    pub causes: Vec<AnsweredCause>,
    /// What cannot be told apart from them.
    #[serde(default)]
    pub alternatives: Vec<AnsweredCause>,
    /// Where most of what is left lies, as far as something is.
    #[serde(default)]
    pub left_at: Option<Location>,
    /// χ² of the displacement per datum, without and with the causes.
    #[serde(default)]
    pub chi2_per_datum: Option<BeforeAfter>,
}

/// A cause of an answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AnsweredCause {
    /// Its name, one of [`cause_names`](crate::diagnosis::cause_names).
    pub name: String,
    /// Its parameters with their intervals, as far as they are told.
    #[serde(default)]
    pub parameters: Vec<ParameterResult>,
}

impl From<&DiagnosisResult> for Answer {
    fn from(result: &DiagnosisResult) -> Answer {
        let causes = |found: &[crate::diagnosis::CauseResult]| {
            found.iter().map(|c| AnsweredCause { name: c.name.clone(), parameters: c.parameters.clone() }).collect()
        };
        Answer {
            verdict: result.verdict,
            causes: causes(&result.causes),
            alternatives: causes(&result.alternatives),
            left_at: result.left_at.clone(),
            chi2_per_datum: Some(result.chi2_per_datum),
        }
    }
}
