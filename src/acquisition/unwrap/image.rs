//! The wrapped phase image.

use std::f64::consts::{PI, TAU};

/// A wrapped phase image with what is known of its noise; lists in the grid's order, x fastest.
#[derive(Clone, Copy, Debug)]
pub struct WrappedImage<'a> {
    /// Voxels along x, y, z.
    pub shape: [usize; 3],
    /// Phase, rad; NaN where missing.
    pub phase: &'a [f64],
    /// Standard deviation of the phase, rad; not finite outside the mask.
    pub sd: &'a [f64],
}

/// The phase within (−π, π].
pub fn wrapped(phase: f64) -> f64 {
    let turned = phase - TAU * (phase / TAU).round();
    if turned <= -PI { turned + TAU } else { turned }
}
