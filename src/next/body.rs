//! Recordings of one body: those that differ in drives alone.

use crate::calibration::Observed;
use crate::sensitivity::Protocol;
use crate::specimen::Specimen;

/// How many of the recordings scanned this specimen at this drive.
pub(super) fn num_done(observed: &[Observed], specimen: &Specimen, drive_mm: f64) -> usize {
    let is_at = |o: &Observed| o.steps.iter().any(|s| Protocol::is_same_drive(s.drive_mm, drive_mm));
    observed.iter().filter(|o| is_same_body(&o.specimen, specimen) && is_at(o)).count()
}

/// Drives of all forces that were read on the way to scans of this specimen, mm, once for each time.
pub(super) fn readings_of(observed: &[Observed], specimen: &Specimen) -> impl Iterator<Item = f64> {
    let of_body = observed.iter().filter(move |o| is_same_body(&o.specimen, specimen));
    of_body.flat_map(|o| o.on_the_way.iter().map(|r| r.drive_mm))
}

/// Whether two specimens differ by name and drives alone, and are driven in the same direction.
pub(super) fn is_same_body(a: &Specimen, b: &Specimen) -> bool {
    let body = |s: &Specimen| Specimen { name: String::new(), drive_mm: Vec::new(), ..s.clone() };
    body(a) == body(b) && !a.is_other_way(b.largest_drive_mm())
}
