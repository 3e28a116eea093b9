//! What a diagnosis of a design's scan would find, in plain words.

use super::detection::{counted, log_sizes};
use super::entry::DesignEntry;
use super::study::Study;
use super::words::{listed, short_number};
use crate::sensitivity::DetectableSize;

/// For each material the sizes that count, of the best design and of the base; nothing where none were asked for.
pub(super) fn sizes_in_words(study: &Study, base: &DesignEntry, best: &DesignEntry) -> Vec<String> {
    let Ok(counted) = counted(study) else { return Vec::new() };
    let of_material = |own: &[DetectableSize], of_base: &[DetectableSize]| -> Option<String> {
        let sizes = log_sizes(&counted, own).into_iter().zip(log_sizes(&counted, of_base)).zip(&counted);
        let shown = |size: f64| short_number(format!("{:.3e}", size.exp()).parse().unwrap_or(f64::NAN));
        let each: Vec<String> = sizes
            .filter_map(|((own, base), c)| {
                let there = base.map_or("has none".to_string(), shown);
                Some(format!("{} {} {} (base: {there})", c.cause, c.parameter, shown(own?)))
            })
            .collect();
        (!each.is_empty()).then(|| listed(&each))
    };
    let pairs = best.by_material.iter().zip(&base.by_material);
    let said = pairs.filter_map(|(own, of_base)| {
        let list = of_material(&own.evaluation.detectable, &of_base.evaluation.detectable)?;
        Some(format!(
            "With material \"{}\" a diagnosis of the best specimen's scan would name errors with 90 % probability from these \
             sizes on: {list}.",
            own.material
        ))
    });
    said.collect()
}
