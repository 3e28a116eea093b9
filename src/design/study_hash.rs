//! What tells one study from another.

use super::study::Study;
use crate::provenance::{VERSION, input_hash};

/// Hash of a study, which a checkpoint must share.
pub fn study_hash(study: &Study) -> String {
    input_hash(&serde_json::json!({ "study": study, "version": VERSION }))
}
