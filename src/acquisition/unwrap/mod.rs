//! Unwrapping a phase image in three dimensions.
//!
//! Neighbouring voxels are taken to differ by less than half a turn; where noise, dephasing or a strong gradient breaks
//! this, the answer depends on the path, and the methods differ in which neighbours they trust ([`Method`]). A phase
//! that changes by many turns along a line of voxels is no difficulty as such.
//!
//! Whatever the method, a voxel is kept only where its multiple of 2π agrees with all its kept neighbours and where it
//! is joined to the largest region through differences that the noise cannot have turned
//! ([`UnwrapOptions::min_margin`]); two methods of different kind must agree about it
//! ([`UnwrapOptions::needs_agreement`]). Voxels that are not kept are counted by cause. The multiple of 2π of the whole
//! region stays open.

mod graph;
mod image;
mod least_squares;
mod quality;
mod reliable;

#[cfg(test)]
mod tests;

pub use image::{WrappedImage, wrapped};

use crate::sensitivity::{MAX_PHASE_SD, MIN_MARGIN};
use graph::Graph;
use std::f64::consts::TAU;

/// How to decide which differences to trust.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, utoipa::ToSchema)]
#[schema(as = UnwrapMethod)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Quality-guided: voxels are joined in the order of each difference's distance from half a turn in units of its
    /// standard deviation, so that differences which noise may have turned come last.
    #[default]
    Margin,
    /// Quality-guided by second differences (Abdul-Rahman et al. 2007, Applied Optics 46, 6623).
    SecondDifference,
    /// Weighted least squares on the differences, reweighted towards least absolute deviations, then made congruent:
    /// the smooth solution picks each voxel's multiple of 2π.
    LeastSquares,
}

/// Settings of [`unwrap`].
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct UnwrapOptions {
    /// How to decide which differences to trust.
    pub method: Method,
    /// Voxels whose phase has a larger standard deviation are left out, rad. At 0.7 two neighbours differ by noise
    /// alone with a standard deviation of one radian.
    pub max_phase_sd: f64,
    /// Regions are joined only through differences at least this many standard deviations away from half a turn.
    pub min_margin: f64,
    /// A second method of the other kind (least squares beside a quality-guided one, [`Method::Margin`] beside least
    /// squares) must find the same turns; voxels where it does not are left out.
    pub needs_agreement: bool,
}

impl Default for UnwrapOptions {
    fn default() -> Self {
        UnwrapOptions {
            method: Method::default(),
            max_phase_sd: MAX_PHASE_SD,
            min_margin: MIN_MARGIN,
            needs_agreement: true,
        }
    }
}

/// An unwrapped image.
#[derive(Clone, Debug)]
pub struct Unwrapped {
    /// Phase, rad, up to one multiple of 2π for all; NaN where left out.
    pub phase: Vec<f64>,
    /// Voxels asked for: those with a finite phase and a finite standard deviation.
    pub num_voxels: usize,
    /// Voxels kept.
    pub num_kept: usize,
    /// Left out because their noise is too high.
    pub num_low_signal: usize,
    /// Left out because a second method found another multiple of 2π.
    pub num_disputed: usize,
    /// Left out because neighbours disagree about the multiple of 2π.
    pub num_inconsistent: usize,
    /// Left out because nothing joins them firmly to the largest region.
    pub num_unconnected: usize,
}

/// Unwraps an image. The lists have one entry per voxel; entries beyond the shape are ignored.
pub fn unwrap(image: &WrappedImage, options: &UnwrapOptions) -> Unwrapped {
    let is_asked = |v: usize| image.phase[v].is_finite() && image.sd[v].is_finite();
    let num_image: usize = image.shape.iter().product();
    let asked: Vec<usize> = (0..num_image).filter(|&v| is_asked(v)).collect();
    let used: Vec<u32> = asked.iter().filter(|&&v| image.sd[v] <= options.max_phase_sd).map(|&v| v as u32).collect();
    let graph = Graph::new(image, &used);
    let whole = unwrapped_by(options.method, &graph);
    let is_agreed = if options.needs_agreement {
        let other = if options.method == Method::LeastSquares { Method::Margin } else { Method::LeastSquares };
        agreed(&whole, &unwrapped_by(other, &graph))
    } else {
        vec![true; used.len()]
    };
    let num_disputed = is_agreed.iter().filter(|a| !**a).count();
    let kept = reliable::kept(&graph, &whole, is_agreed, options.min_margin);
    let mut phase = vec![f64::NAN; image.phase.len()];
    for (n, &voxel) in used.iter().enumerate() {
        if kept.is_kept[n] {
            phase[voxel as usize] = whole[n];
        }
    }
    Unwrapped {
        phase,
        num_voxels: asked.len(),
        num_kept: kept.is_kept.iter().filter(|k| **k).count(),
        num_low_signal: asked.len() - used.len(),
        num_disputed,
        num_inconsistent: kept.num_inconsistent,
        num_unconnected: kept.num_unconnected,
    }
}

fn unwrapped_by(method: Method, graph: &Graph) -> Vec<f64> {
    match method {
        Method::Margin => quality::by_margin(graph),
        Method::SecondDifference => quality::by_second_difference(graph),
        Method::LeastSquares => least_squares::congruent(graph),
    }
}

/// Where two answers differ by the number of turns by which most voxels do.
fn agreed(a: &[f64], b: &[f64]) -> Vec<bool> {
    let turns: Vec<i64> = a.iter().zip(b).map(|(a, b)| ((a - b) / TAU).round() as i64).collect();
    let mut sorted = turns.clone();
    sorted.sort_unstable();
    // The median is the most frequent number where one of them has the majority.
    let usual = sorted.get(sorted.len() / 2).copied().unwrap_or(0);
    turns.iter().map(|t| *t == usual).collect()
}
