//! What a proof comes to: every scored diagnosis, sums per cause, and the whole.

use super::draw::{Hidden, HiddenCause};
use crate::diagnosis::Verdict;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// One diagnosis of a concealed cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Scored {
    /// What was hidden.
    pub hidden: Hidden,
    /// Whether the diagnosis knew of the cause.
    pub is_known: bool,
    /// The verdict; null where the diagnosis failed.
    pub verdict: Option<Verdict>,
    /// Causes named, first found first; of alternatives that cannot be told apart too, after them.
    pub named: Vec<String>,
    /// Change of the displacement by the cause at the largest drive, mm rms.
    pub effect_rms_mm: f64,
    /// Largest relative change of a force.
    pub effect_force_relative: f64,
    /// Whether theory says that it can be seen.
    pub is_detectable: bool,
    /// Whether it is right: the hidden cause first; none named where none is hidden; unexplained where not known.
    pub is_right: bool,
    /// Whether nothing was left unexplained.
    #[serde(default)]
    pub is_explained: bool,
    /// Distance from the place found to the hidden one, mm: of the cause, or of what is left where it is not known.
    pub location_error_mm: Option<f64>,
    /// Half the diagonal of the hidden place, mm.
    pub location_size_mm: Option<f64>,
    /// Parameters of the hidden cause: name, and estimate minus truth in half widths of the 95 % interval.
    #[schema(value_type = Vec<Vec<serde_json::Value>>)]
    pub deviations: Vec<(String, f64)>,
    /// χ² per datum before and after; null where there is no diagnosis.
    pub chi2: Option<[f64; 2]>,
    /// Why there is no diagnosis: it failed, or the recording could not be made.
    pub failure: Option<String>,
}

impl Scored {
    /// Before there is a diagnosis.
    pub(super) fn undiagnosed(hidden: &Hidden, is_known: bool) -> Scored {
        Scored {
            hidden: hidden.clone(),
            is_known,
            verdict: None,
            named: Vec::new(),
            effect_rms_mm: 0.0,
            effect_force_relative: 0.0,
            is_detectable: false,
            is_right: false,
            is_explained: false,
            location_error_mm: None,
            location_size_mm: None,
            deviations: Vec::new(),
            chi2: None,
            failure: None,
        }
    }
}

/// What a diagnosis named first. Results write the cause's name, or `(none)`, `(unexplained)`, `(failed)`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(from = "String", into = "String")]
pub enum FirstNamed {
    /// A cause.
    Cause(String),
    /// No cause: there is no mismatch.
    Nothing,
    /// No cause: the mismatch is unexplained.
    Unexplained,
    /// There is no diagnosis.
    Failed,
}

impl FirstNamed {
    /// Of a scored diagnosis.
    pub(super) fn of(scored: &Scored) -> FirstNamed {
        match (scored.named.first(), scored.verdict) {
            (Some(name), _) => FirstNamed::Cause(name.clone()),
            (None, Some(Verdict::Unexplained)) => FirstNamed::Unexplained,
            (None, Some(_)) => FirstNamed::Nothing,
            (None, None) => FirstNamed::Failed,
        }
    }
}

const NOTHING: &str = "(none)";
const UNEXPLAINED: &str = "(unexplained)";
const FAILED: &str = "(failed)";

impl std::fmt::Display for FirstNamed {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(match self {
            FirstNamed::Cause(name) => name,
            FirstNamed::Nothing => NOTHING,
            FirstNamed::Unexplained => UNEXPLAINED,
            FirstNamed::Failed => FAILED,
        })
    }
}

impl From<FirstNamed> for String {
    fn from(named: FirstNamed) -> String {
        named.to_string()
    }
}

impl From<String> for FirstNamed {
    fn from(text: String) -> FirstNamed {
        match &*text {
            NOTHING => FirstNamed::Nothing,
            UNEXPLAINED => FirstNamed::Unexplained,
            FAILED => FirstNamed::Failed,
            _ => FirstNamed::Cause(text),
        }
    }
}

/// Sums over one hidden cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CauseSummary {
    /// The cause.
    pub cause: HiddenCause,
    /// Recordings.
    pub num_recordings: usize,
    /// Of these, detectable.
    pub num_detectable: usize,
    /// Right among all.
    pub num_right: usize,
    /// Right among the detectable.
    pub num_right_detectable: usize,
    /// Right with nothing left unexplained, of all.
    pub num_right_explained: usize,
    /// Nothing named.
    pub num_silent: usize,
    /// Median distance to the hidden place where named right, mm.
    pub median_location_error_mm: Option<f64>,
    /// Intervals that hold the truth, and all intervals, where named right.
    pub num_covered: [usize; 2],
    /// How often each cause was named first, the most frequent first.
    #[schema(value_type = Vec<Vec<serde_json::Value>>)]
    pub first_named: Vec<(FirstNamed, usize)>,
}

/// A proof.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Proof {
    /// `proof/1`.
    pub schema: String,
    /// Every diagnosis.
    pub scored: Vec<Scored>,
    /// Causes known to the diagnosis.
    pub known: Vec<CauseSummary>,
    /// Causes kept from it.
    pub unknown: Vec<CauseSummary>,
    /// Right among the detectable, causes together; this share and the others are null where there was none.
    #[schema(value_type = Option<f64>)]
    pub right_of_detectable: f64,
    /// Controls in which a cause was named or left unexplained.
    #[schema(value_type = Option<f64>)]
    pub false_alarm_rate: f64,
    /// Unknown detectable causes that were called unexplained.
    #[schema(value_type = Option<f64>)]
    pub unexplained_of_unknown: f64,
    /// Share of intervals that hold the truth.
    #[schema(value_type = Option<f64>)]
    pub interval_coverage: f64,
    /// Program version.
    pub version: String,
    /// The build (see [`crate::provenance::build_id`]).
    pub build: String,
    /// Hash of the settings.
    pub input_hash: String,
}
