//! What matters of each result, as text for a terminal.

mod calibration;
mod curves;
mod design;
mod diagnosis;
mod evaluation;
mod export;
mod load_curves;
mod next;
mod paper_tables;
mod proof;
mod scan;
mod several;
mod solve;
mod sweep;

use crate::report::plain_number;
use std::borrow::Borrow;

pub(super) use calibration::calibration;
pub(super) use curves::{curves, uniaxial};
pub(super) use design::design;
pub(super) use diagnosis::{diagnosis, together};
pub(super) use evaluation::evaluation;
pub(super) use export::{export_material, export_model, export_recording};
pub(super) use load_curves::load_curves;
pub(super) use next::next;
pub(super) use paper_tables::paper_tables;
pub(super) use proof::proof;
pub(super) use scan::{import, scan};
pub(super) use several::several;
pub(super) use solve::solve;
pub(super) use sweep::sweep;

/// A number with significant digits, as all summaries show numbers: neither a row of zeros for a small one nor three
/// hundred digits for a large one.
fn num(value: impl Borrow<f64>, digits: usize) -> String {
    plain_number(*value.borrow(), digits)
}
