//! The comparison.

use super::error::CompareError;
use super::figure::{Judgement, Line};
use super::read::Subject;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use utoipa::ToSchema;

/// Longest value shown when two conditions differ, characters.
const SHOWN: usize = 120;

/// How results are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompareOptions {
    /// Relative change up to which a figure counts as the same.
    pub relative_tolerance: f64,
    /// Any change beyond the tolerance counts as worse, improvements too: for baselines that are changed on purpose
    /// only.
    pub is_strict: bool,
    /// Compare evaluations of different specimens, meshes or drives: only scan, material and normalisation must agree.
    pub across_inputs: bool,
}

impl Default for CompareOptions {
    fn default() -> Self {
        // Far above what another processor's rounding changes (solver tolerance 1e-8 and below), far below any effect.
        CompareOptions { relative_tolerance: 1e-5, is_strict: false, across_inputs: false }
    }
}

/// Two results compared (`comparison/1`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Comparison {
    /// Name of what was compared.
    pub name: String,
    /// Schema of both results.
    pub kind: String,
    /// Figures that agree within the tolerance.
    pub num_same: usize,
    /// Figures that are better.
    pub num_better: usize,
    /// Figures that changed where no way is better.
    pub num_changed: usize,
    /// Figures that are worse.
    pub num_worse: usize,
    /// Whether the current result counts as worse.
    pub is_worse: bool,
    /// What is worth knowing besides, such as another version of the program.
    pub notes: Vec<String>,
    /// Every figure that is not the same, worst first, by size of the change.
    pub differences: Vec<Line>,
}

/// Compares two results.
///
/// # Errors
/// [`CompareError::NotComparable`] with every reason.
pub fn compare(
    name: &str,
    base: &Subject,
    current: &Subject,
    options: &CompareOptions,
) -> Result<Comparison, CompareError> {
    if base.schema != current.schema {
        let reasons = vec![format!("one is {}, the other {}", base.schema, current.schema)];
        return Err(CompareError::NotComparable { reasons });
    }
    let mut reasons = differences(&base.conditions, &current.conditions);
    if !options.across_inputs {
        reasons.extend(differences(&base.inputs, &current.inputs));
    }
    let found: HashMap<&str, Option<f64>> = current.figures.iter().map(|f| (f.name.as_str(), f.value)).collect();
    let mut lines = Vec::with_capacity(base.figures.len());
    let mut lost = 0usize;
    for figure in &base.figures {
        match found.get(figure.name.as_str()) {
            Some(value) => lines.push(Line::new(figure, *value, options.relative_tolerance)),
            None if current.tells_of_failures => lost += 1,
            None => reasons.push(format!("the current result has no '{}'", figure.name)),
        }
    }
    if !reasons.is_empty() {
        return Err(CompareError::NotComparable { reasons });
    }
    let count = |j: Judgement| lines.iter().filter(|l| l.judgement == j).count();
    let (num_same, num_better) = (count(Judgement::Same), count(Judgement::Better));
    let (num_changed, num_worse) = (count(Judgement::Changed), count(Judgement::Worse));
    let mut notes = Vec::new();
    if base.version != current.version {
        notes.push(format!("the base was made by version {}, the current result by {}", base.version, current.version));
    }
    if lost > 0 {
        notes.push(format!("{lost} figures of tasks that fail now have no counterpart"));
    }
    lines.retain(|l| l.judgement != Judgement::Same);
    let size = |l: &Line| l.relative_change.map_or(f64::INFINITY, f64::abs);
    lines.sort_by(|a, b| b.judgement.cmp(&a.judgement).then(size(b).total_cmp(&size(a))));
    Ok(Comparison {
        name: name.into(),
        kind: base.schema.clone(),
        num_same,
        num_better,
        num_changed,
        num_worse,
        is_worse: num_worse > 0 || (options.is_strict && num_better + num_changed > 0),
        notes,
        differences: lines,
    })
}

/// Conditions that differ, in words.
fn differences(base: &[(String, String)], current: &[(String, String)]) -> Vec<String> {
    let shown = |text: &str| {
        let short: String = text.chars().take(SHOWN).collect();
        if short.len() < text.len() { format!("{short}…") } else { short }
    };
    let other: HashMap<&str, &str> = current.iter().map(|(n, v)| (n.as_str(), v.as_str())).collect();
    base.iter()
        .filter_map(|(name, value)| match other.get(name.as_str()) {
            Some(found) if found == value => None,
            Some(found) if shown(found) == shown(value) => Some(format!("{name}: not the same")),
            Some(found) => Some(format!("{name}: {} against {}", shown(value), shown(found))),
            None => Some(format!("{name}: missing in the current result")),
        })
        .collect()
}

#[cfg(test)]
#[path = "verdict_tests.rs"]
mod tests;
