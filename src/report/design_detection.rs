//! The errors of an experiment that a diagnosis would name, of the base and of the recommended specimen.

use super::{Column, Report, Table, detectable_picture, significant, telling};
use crate::design::DesignResult;
use crate::sensitivity::DetectableSize;

/// A section with table and picture, where the study asked for it.
pub(super) fn detection(page: &mut Report, result: &DesignResult) {
    let compared = compared_sizes(result);
    if compared.is_empty() {
        return;
    }
    page.section("Errors that would be named");
    page.table(&Table {
        caption: "The smallest errors that a diagnosis of one scan would name with 90 % probability.".into(),
        columns: vec![
            Column::words("Material"),
            Column::words("Cause"),
            Column::words("Parameter"),
            Column::numbers("Base", "unit in the name"),
            Column::numbers("Recommended", "unit in the name"),
            Column::numbers("Base / recommended", "×"),
        ],
        rows: compared.iter().map(ComparedSize::cells).collect(),
        note: "Of several holes the one whose error must be largest; of causes with many parameters the hardest."
            .into(),
        ..Table::default()
    });
    if let Some(first) = result.recommended().by_material.first() {
        let caption = format!("Recommended specimen, material \"{}\".", first.material);
        page.figure(&detectable_picture(&first.evaluation.detectable), &caption);
    }
}

/// One parameter of a cause in both specimens.
#[derive(Clone, Debug, PartialEq)]
pub struct ComparedSize {
    /// Name of the material.
    pub material: String,
    /// Name of the cause.
    pub cause: String,
    /// The parameter, with its unit.
    pub parameter: String,
    /// Size with the base, infinite where it would never be named; `None` where the base has no such parameter.
    pub base: Option<f64>,
    /// The same with the recommended specimen.
    pub recommended: Option<f64>,
}

impl ComparedSize {
    /// A size as tables show it.
    pub fn shown(size: Option<f64>) -> String {
        match size {
            None => "–".into(),
            Some(size) if size.is_finite() => significant(size, 3),
            Some(_) => "never".into(),
        }
    }

    /// Base over recommended; `None` where one of them has no size.
    pub fn gain(&self) -> Option<f64> {
        let (base, own) = (self.base?, self.recommended?);
        (base.is_finite() && own.is_finite()).then_some(base / own)
    }

    fn cells(&self) -> Vec<String> {
        vec![
            self.material.clone(),
            self.cause.clone(),
            self.parameter.clone(),
            Self::shown(self.base),
            Self::shown(self.recommended),
            self.gain().map_or("–".into(), |gain| significant(gain, 3)),
        ]
    }
}

/// The sizes of base and recommended specimen with every material; none where the study did not ask for them.
pub fn compared_sizes(result: &DesignResult) -> Vec<ComparedSize> {
    let mut compared: Vec<ComparedSize> = Vec::new();
    for (own, of_base) in result.recommended().by_material.iter().zip(&result.base.by_material) {
        let (own_sizes, base_sizes) = (&own.evaluation.detectable, &of_base.evaluation.detectable);
        for (row, _) in telling(own_sizes).into_iter().chain(telling(base_sizes)) {
            let is_known =
                |c: &ComparedSize| (&c.material, &c.cause, &c.parameter) == (&own.material, &row.cause, &row.parameter);
            if !compared.iter().any(is_known) {
                compared.push(ComparedSize {
                    material: own.material.clone(),
                    cause: row.cause.clone(),
                    parameter: row.parameter.clone(),
                    base: worst(base_sizes, row),
                    recommended: worst(own_sizes, row),
                });
            }
        }
    }
    compared
}

/// The largest size of a parameter over the suspects that have it.
fn worst(sizes: &[DetectableSize], like: &DetectableSize) -> Option<f64> {
    let own = sizes.iter().filter(|s| s.cause == like.cause && s.parameter == like.parameter);
    own.map(|s| s.size.unwrap_or(f64::INFINITY)).reduce(f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gains_are_of_what_both_have() {
        let size = |base: Option<f64>, recommended: Option<f64>| ComparedSize {
            material: "soft".into(),
            cause: "hole".into(),
            parameter: "diameter_error_mm".into(),
            base,
            recommended,
        };
        assert_eq!(size(Some(0.5), Some(0.25)).gain(), Some(2.0));
        assert_eq!(size(Some(f64::INFINITY), Some(0.25)).gain(), None);
        assert_eq!(size(Some(0.5), None).cells()[3..], ["0.500", "–", "–"]);
        assert_eq!(ComparedSize::shown(Some(f64::INFINITY)), "never");
    }
}
