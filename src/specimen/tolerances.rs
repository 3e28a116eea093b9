//! By how much the dimensions on a drawing may be off.

use super::drawing_sheet::format_mm;

/// Tolerances of a sample's drawing, each ± mm; `None` where nothing is said.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tolerances {
    /// Of length, thickness and width of the block.
    pub block_mm: [Option<f64>; 3],
    /// Of the holes, in their order; empty where nothing is said of any.
    pub holes: Vec<HoleTolerances>,
}

/// Tolerances of a hole, each ± mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HoleTolerances {
    /// Of the two coordinates of its centre.
    pub center_mm: [Option<f64>; 2],
    /// Of its diameter, or of its extent across.
    pub diameter_mm: Option<f64>,
    /// Of its length, where it is longer than wide.
    pub length_mm: Option<f64>,
}

/// A dimension on a drawing, with its tolerance where it has one.
pub(super) fn dimension(value_mm: f64, tolerance_mm: Option<f64>) -> String {
    let tolerance = tolerance_mm.map_or(String::new(), |t| format!(" ±{}", format_mm(t)));
    format_mm(value_mm) + &tolerance
}
