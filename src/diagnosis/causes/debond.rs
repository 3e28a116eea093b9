//! A plate lets go of a part of the sample.

use crate::diagnosis::candidate::Candidate;
use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::error::DiagnosisError;
use crate::diagnosis::location::Location;
use crate::diagnosis::maps::FacePatch;
use crate::diagnosis::scene::Scene;
use crate::diagnosis::search::Search;
use crate::fem::Field;
use crate::specimen::Specimen;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("debond");
/// What a laboratory can do about it.
const REMEDY: &str =
    "Bond the face anew and look at its edges before the scan; in a finished recording leave the patch in the model.";
/// Its line in the registry.
pub(super) const ENTRY: Entry = Entry { name: NAME, remedy: REMEDY, origin: Origin::Searched(suspects) };

/// Width of the edge of a debonded patch, mm. It is a third of the spacing of nodes on the face, so that the bond
/// changes smoothly as the edge passes from node to node.
const EDGE_MM: f64 = 0.35;
/// Strips of bond beside a patch that are tried, mm.
const STRIPS_MM: [f64; 3] = [0.6, 1.3, 2.6];
/// How loose the inside of the patch is: free but for 1/1000 of the sample's own stiffness, which keeps the patch in
/// place.
const LOOSE: f64 = 0.999;

/// A rectangular patch of a bonded face without bond.
pub struct Debond {
    /// Whether on the moved face.
    pub is_moved_face: bool,
    /// The two axes in the face.
    pub axes: [usize; 2],
    /// The axis across the face and where the face lies on it, mm.
    pub face: (usize, f64),
    /// Start: low and high edge along the two axes, mm.
    pub edges_mm: [[f64; 2]; 2],
    /// Half extents of the face along the two axes, mm.
    pub half_mm: [f64; 2],
}

/// The patch of each bonded face that explains most.
fn suspects(search: &mut Search) -> Result<Vec<Candidate>, DiagnosisError> {
    let patches = search.bond_maps()?.iter().flatten().filter_map(|bond| bond.patch.as_ref());
    Ok(patches
        .map(|patch| {
            let cause = Debond::of(patch);
            Candidate { values: cause.start(), cause: Arc::new(cause), score: patch.explained }
        })
        .collect())
}

impl Debond {
    /// Starts from a patch of a map.
    fn of(patch: &FacePatch) -> Debond {
        let FacePatch { is_moved_face, axes, face, edges_mm, half_mm, .. } = *patch;
        Debond { is_moved_face, axes, face, edges_mm, half_mm }
    }

    /// Names of the axes.
    fn axis_name(axis: usize) -> &'static str {
        ["x", "y", "z"][axis]
    }

    /// How loose the bond is with an edge of the patch `edge_mm` wide.
    fn patch(&self, values: &[f64], edge_mm: f64) -> Field {
        let (axes, half) = (self.axes, self.half_mm);
        let edges = [[values[0], values[1]], [values[2], values[3]]];
        Field::new(move |x| {
            // Distance into the patch from its nearest edge; edges on the face's own boundary do not count.
            let mut inside = f64::INFINITY;
            for a in 0..2 {
                let p = x[axes[a]];
                if edges[a][0] > -half[a] {
                    inside = inside.min(p - edges[a][0]);
                }
                if edges[a][1] < half[a] {
                    inside = inside.min(edges[a][1] - p);
                }
            }
            let s = 1.0 / (1.0 + (-(inside / edge_mm)).clamp(-60.0, 60.0).exp());
            // At the edge itself the bond is half loose. A looseness below a thousandth is taken as none.
            if s < 1e-3 { 0.0 } else { LOOSE * s }
        })
    }

    fn clipped(&self, values: &[f64]) -> [[f64; 2]; 2] {
        [0, 1].map(|a| [values[2 * a].max(-self.half_mm[a]), values[2 * a + 1].min(self.half_mm[a])])
    }
}

impl Cause for Debond {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Boundary
    }

    fn description(&self) -> String {
        let plate = if self.is_moved_face { "moved" } else { "fixed" };
        format!("the {plate} plate has let go of a part of the sample")
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        let mut all = Vec::new();
        for (axis, half) in self.axes.iter().zip(self.half_mm) {
            let name = Self::axis_name(*axis);
            // An edge past the face's own edge means that the patch ends with the face.
            let range = [-half - 0.5, half + 0.5];
            all.push(CauseParameter::new(format!("low_{name}_mm"), 0.5, range));
            all.push(CauseParameter::new(format!("high_{name}_mm"), 0.5, range));
        }
        all
    }

    fn variant(&self) -> [i64; 3] {
        [i64::from(self.is_moved_face), 0, 0]
    }

    fn max_suspects(&self) -> usize {
        2
    }

    fn start(&self) -> Vec<f64> {
        self.edges_mm.iter().flatten().copied().collect()
    }

    /// The misfit does not change while an edge lies past the face's own, so that no slope leads a fit back from there.
    /// It must be tried whether a strip of bond holds beside that edge, and where a narrow strip was found, whether
    /// there is one at all.
    fn leaps(&self, values: &[f64]) -> Vec<Vec<f64>> {
        let mut all = Vec::new();
        for (i, &edge) in values.iter().enumerate() {
            let side = if i % 2 == 0 { -1.0 } else { 1.0 };
            let half = self.half_mm[i / 2];
            // Depth of the edge inside the face.
            let depth = half - side * edge;
            let mut put = |depth: f64| {
                let mut other = values.to_vec();
                other[i] = side * (half - depth);
                // Some patch must be left.
                if other[2 * (i / 2) + 1] - other[2 * (i / 2)] > 1.0 {
                    all.push(other);
                }
            };
            if depth <= 0.0 {
                STRIPS_MM.into_iter().for_each(&mut put);
            } else if depth < 2.0 * STRIPS_MM[0] {
                put(-0.4);
            }
        }
        all
    }

    fn is_idealised(&self) -> bool {
        true
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        scene.looseness[usize::from(self.is_moved_face)].push(self.patch(values, EDGE_MM));
    }

    fn apply_wider(&self, values: &[f64], scene: &mut Scene) -> bool {
        scene.looseness[usize::from(self.is_moved_face)].push(self.patch(values, 2.0 * EDGE_MM));
        true
    }

    fn location(&self, values: &[f64], _: &Specimen) -> Option<Location> {
        let edges = self.clipped(values);
        let (mut center_mm, mut extent_mm) = ([0.0; 3], [0.0; 3]);
        for a in 0..2 {
            center_mm[self.axes[a]] = 0.5 * (edges[a][0] + edges[a][1]);
            extent_mm[self.axes[a]] = (edges[a][1] - edges[a][0]).max(0.0);
        }
        center_mm[self.face.0] = self.face.1;
        let sign = if self.is_moved_face { '+' } else { '-' };
        let region = format!("patch of the {sign}{} bonded face", Self::axis_name(self.face.0));
        Some(Location { region, center_mm, extent_mm })
    }
}
