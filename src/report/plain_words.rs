//! What a diagnosis means for a laboratory, in plain words: what was wrong, what to change, what the material is.

use super::html::Report;
use super::html_parts::{Column, Table};
use super::number::significant;
use crate::diagnosis::{Diagnosis, DiagnosisResult, ParameterResult, Verdict};

/// A parameter is hardly known where its interval is wider than this part of its value.
const HARDLY_KNOWN: f64 = 1.0;

/// Adds what was wrong, what to change and what the material is.
pub(super) fn in_plain_words(page: &mut Report, d: &Diagnosis, r: &DiagnosisResult) {
    page.paragraph(&what_was_wrong(r));
    if !r.causes.is_empty() {
        let mut causes: Vec<_> = r.causes.iter().collect();
        causes.sort_by(|a, b| b.effect_rms_mm.total_cmp(&a.effect_rms_mm));
        page.table(&Table {
            caption: "What to change".into(),
            columns: vec![
                Column::words("what was wrong"),
                Column::numbers("it changes what was recorded by", "mm rms"),
                Column::words("what a laboratory can do"),
            ],
            rows: causes
                .iter()
                .map(|c| vec![sentence(&c.description), significant(c.effect_rms_mm, 2), c.remedy.clone()])
                .collect(),
            ..Table::default()
        });
    }
    page.paragraph(&what_the_material_is(d, r));
}

/// What was wrong with the experiment.
fn what_was_wrong(r: &DiagnosisResult) -> String {
    let (before, after) = (r.structured_rms_mm.before, r.structured_rms_mm.after);
    let left = format!("{} of {} mm rms", significant(after, 2), significant(before, 2));
    let named = match r.causes.len() {
        0 => "No cause can be named.".into(),
        1 => "One thing was found that differs from what was told of the experiment.".into(),
        n => format!("{n} things were found that differ from what was told of the experiment."),
    };
    let ends = match r.verdict {
        Verdict::NoMismatch => {
            return "Nothing was found to be wrong: the experiment as told explains the recording up to its noise and \
                    what meshes leave."
                .into();
        }
        Verdict::Explained => "With that, nothing is left but noise and what meshes leave.".into(),
        Verdict::ExplainedAmbiguously => {
            "That explains the recording, but so would something else, which this recording cannot tell from it.".into()
        }
        Verdict::Unexplained => format!(
            "Not all of the misfit is explained: {left} are left, which no cause known to the program explains. \
             Estimates below include what this leaves open as far as halves of the recording tell it."
        ),
    };
    let inside = r.interior.as_ref().map_or(String::new(), |test| {
        let words = test.origin.in_words();
        format!(
            " Before any cause was asked, a part inside the sample was driven by what was measured around it: {words}."
        )
    });
    format!("{named} {ends}{inside}")
}

/// What the recording tells of the material.
fn what_the_material_is(d: &Diagnosis, r: &DiagnosisResult) -> String {
    let has_force = d.observed.steps.iter().any(|s| s.force.is_some());
    let (mut known, mut unknown) = (Vec::new(), Vec::new());
    for (kind, p) in r.material.parameters().into_iter().zip(&r.material_parameters) {
        // Without a force no modulus is known, whatever its interval among the others.
        let is_modulus = kind.is_modulus();
        match p.interval_95.filter(|i| is_known(p, *i) && (has_force || !is_modulus)) {
            Some([a, b]) => known.push(format!(
                "{} is {}{} (95 % interval {} to {})",
                p.name.replace('_', " "),
                significant(p.value, 3),
                if is_modulus { " kPa" } else { "" },
                significant(a, 3),
                significant(b, 3)
            )),
            None => unknown.push(p.name.replace('_', " ")),
        }
    }
    let mut text = String::from("The material: ");
    text += &if known.is_empty() { "nothing is known of it".into() } else { known.join("; ") };
    text += ".";
    if !unknown.is_empty() {
        text += &format!(" This recording does not tell {}.", unknown.join(", "));
    }
    if !has_force {
        text += " No force was recorded: displacements tell exponents and ratios of moduli, and no modulus.";
    }
    text
}

fn is_known(p: &ParameterResult, [a, b]: [f64; 2]) -> bool {
    b - a < HARDLY_KNOWN * p.value.abs()
}

/// `text` with a capital first letter.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().collect::<String>() + letters.as_str())
}
