//! Where a bar that is pushed together would touch itself or its grips. Contact is not modelled: surfaces go through
//! each other, and an equilibrium beyond that is none of a real sample.

use super::equilibrium::Equilibrium;
use super::forward_model::ForwardModel;
use crate::specimen::{HoleAxis, HoleWall, Specimen};
use serde::{Deserialize, Serialize};

/// How far from a hole's wall a node may lie and be one of the wall's, and how far beyond a grip's plane one may lie
/// without having passed it, relative to the bar's length: rounding.
const TOLERANCE: f64 = 1e-6;

/// What of a pushed bar passes through something else; nothing of it in other tests, where it is not looked for.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// How far a free side has bulged past the plane of a grip, mm.
    pub beyond_grips_mm: f64,
    /// Holes, from 0, whose walls have met: the hole is closed.
    pub closed_holes: Vec<usize>,
}

impl Contact {
    /// Whether nothing touches.
    pub fn is_none(&self) -> bool {
        self.beyond_grips_mm <= 0.0 && self.closed_holes.is_empty()
    }

    /// What touches, in words; empty where nothing does.
    pub fn in_words(&self) -> String {
        let mut told = Vec::new();
        if self.beyond_grips_mm > 0.0 {
            told.push(format!("the free sides bulge {:.3} mm past the grips", self.beyond_grips_mm));
        }
        told.extend(self.closed_holes.iter().map(|hole| format!("holes[{hole}] is closed")));
        told.join(", ")
    }
}

impl ForwardModel {
    /// What passes through something else at an equilibrium of `specimen`, whose model this is.
    pub fn contact(&self, specimen: &Specimen, at: &Equilibrium) -> Contact {
        let mesh = self.mesh();
        if !specimen.is_compressed() {
            return Contact::default();
        }
        let length = specimen.block.length_mm;
        let tolerance = TOLERANCE * length;
        let position = |v: usize| [0, 1, 2].map(|i| mesh.nodes[v][i] + at.displacement[v][i]);
        let (low, high) = (-0.5 * length, 0.5 * length + at.drive_mm);
        let beyond = |v: usize| (low - position(v)[0]).max(position(v)[0] - high);
        let farthest = (0..mesh.nodes.len()).map(beyond).fold(0.0, f64::max);
        let (section, level) = match specimen.hole_axis() {
            Some(HoleAxis::Width) => ([0, 1], 2),
            _ => ([0, 2], 1),
        };
        let in_section = |p: [f64; 3]| section.map(|i| p[i]);
        let is_closed = |wall: &HoleWall| {
            let center = wall.center_mm();
            let is_on = |v: &usize| wall.distance_mm(in_section(mesh.nodes[*v])).abs() < tolerance;
            let mut nodes: Vec<(f64, f64, usize)> = (0..mesh.nodes.len())
                .filter(is_on)
                .map(|v| {
                    let p = in_section(mesh.nodes[v]);
                    (mesh.nodes[v][level], (p[1] - center[1]).atan2(p[0] - center[0]), v)
                })
                .collect();
            nodes.sort_by(|a, b| a.0.total_cmp(&b.0));
            // The wall on each level of the extrusion is a line around the hole.
            let levels = nodes.chunk_by_mut(|a, b| (a.0 - b.0).abs() < tolerance);
            levels.into_iter().any(|line| {
                line.sort_by(|a, b| a.1.total_cmp(&b.1));
                let line: Vec<[f64; 2]> = line.iter().map(|n| in_section(position(n.2))).collect();
                crosses_itself(&line)
            })
        };
        let holes = specimen.holes.iter().enumerate();
        Contact {
            beyond_grips_mm: if farthest > tolerance { farthest } else { 0.0 },
            closed_holes: holes.filter(|(_, hole)| is_closed(&hole.wall())).map(|(index, _)| index).collect(),
        }
    }
}

/// Whether two sides of a closed polygon that do not follow each other cross.
fn crosses_itself(corners: &[[f64; 2]]) -> bool {
    let n = corners.len();
    let side = |i: usize| (corners[i], corners[(i + 1) % n]);
    (0..n).any(|i| (i + 2..n).any(|j| (j + 1) % n != i && cross(side(i), side(j))))
}

/// Whether two segments cross inside both.
fn cross((a, b): ([f64; 2], [f64; 2]), (c, d): ([f64; 2], [f64; 2])) -> bool {
    let turn = |p: [f64; 2], q: [f64; 2], r: [f64; 2]| (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
    turn(a, b, c) * turn(a, b, d) < 0.0 && turn(c, d, a) * turn(c, d, b) < 0.0
}

#[cfg(test)]
mod tests {
    use super::crosses_itself;

    #[test]
    fn a_line_that_crosses_itself_is_told_from_one_that_does_not() {
        let round: Vec<[f64; 2]> =
            (0..12).map(|i| (i as f64 / 12.0 * std::f64::consts::TAU).sin_cos().into()).collect();
        assert!(!crosses_itself(&round));
        // Flattened until the two sides have passed through each other in the middle.
        let passed: Vec<[f64; 2]> = round.iter().map(|[x, y]| [*x, y * (x * x - 0.5)]).collect();
        assert!(crosses_itself(&passed));
    }
}
