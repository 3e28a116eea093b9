//! Prepared models: one per block as made and per set of released faces, each with how the scan sees it.

use super::error::DiagnosisError;
use super::scene::{Pose, Scene};
use crate::calibration::{Observed, Placing, View};
use crate::fem::{Equilibrium, ForwardModel};
use crate::mesh::{BlockShape, DesignVariable, Mesh, half_extents_mm, made_mesh, morphed, shape_velocity};
use crate::specimen::Specimen;

/// Most prepared models kept: one nominal, some with released faces, other holes or faces.
const MAX_STATIONS: usize = 4;

/// A prepared model: one mesh, one set of released faces.
pub(super) struct Station {
    holes: Vec<[f64; 3]>,
    releases: [bool; 2],
    shape: BlockShape,
    /// The mesh of the drawn block with the holes as made.
    drawn: Mesh,
    /// Of the block as made.
    pub(super) model: ForwardModel,
    /// Of the image as it lies.
    pub(super) view: View,
    pose: Pose,
    /// The last equilibria, from which the next start.
    pub(super) states: Vec<Equilibrium>,
}

impl Station {
    /// Where the view takes the image to lie.
    pub(super) fn pose(&self) -> &Pose {
        &self.pose
    }
}

/// The prepared models of one recording.
pub(super) struct Stations<'a> {
    observed: &'a Observed,
    nominal: Mesh,
    all: Vec<Station>,
}

impl std::ops::Index<usize> for Stations<'_> {
    type Output = Station;

    fn index(&self, at: usize) -> &Station {
        &self.all[at]
    }
}

impl std::ops::IndexMut<usize> for Stations<'_> {
    fn index_mut(&mut self, at: usize) -> &mut Station {
        &mut self.all[at]
    }
}

impl<'a> Stations<'a> {
    /// None yet; `nominal` is the mesh of the specimen as drawn.
    pub(super) fn new(observed: &'a Observed, nominal: Mesh) -> Stations<'a> {
        Stations { observed, nominal, all: Vec::new() }
    }

    /// Forgets the equilibria.
    pub(super) fn forget(&mut self) {
        self.all.iter_mut().for_each(|s| s.states.clear());
    }

    /// The station of a scene, made where there is none.
    ///
    /// # Errors
    /// [`DiagnosisError`]: the scene's specimen cannot be modelled.
    pub(super) fn at(&mut self, scene: &Scene) -> Result<usize, DiagnosisError> {
        let drawn = &self.observed.specimen;
        let holes: Vec<[f64; 3]> =
            (0..drawn.holes.len()).map(|n| scene.holes.get(n).copied().unwrap_or([0.0; 3])).collect();
        let releases = scene.releases();
        let made = scene.specimen(drawn);
        let pose = seen_pose(&made, scene);
        let same_holes = |s: &Station| {
            let same = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).all(|(x, y)| x.to_bits() == y.to_bits());
            s.holes.iter().zip(&holes).all(|(a, b)| same(a, b))
        };
        let found = self.all.iter().position(|s| s.releases == releases && s.shape == scene.shape && same_holes(s));
        if let Some(at) = found {
            let station = &mut self.all[at];
            if station.pose != pose {
                station.view = self.observed.placed_view(&made, &station.drawn, &placing(&pose, scene.shape))?;
                station.pose = pose;
            }
            return Ok(at);
        }
        made.validate().map_err(DiagnosisError::Specimen)?;
        let mut mesh = self.nominal.clone();
        for (hole, change) in holes.iter().enumerate() {
            for (variable, &by) in hole_variables(hole).into_iter().zip(change) {
                if by.abs() > 0.0 {
                    let velocity = shape_velocity(&self.nominal, drawn, variable);
                    mesh = morphed(&mesh, &velocity, by);
                }
            }
        }
        let view = self.observed.placed_view(&made, &mesh, &placing(&pose, scene.shape))?;
        let as_made = made_mesh(&mesh, drawn, &scene.shape);
        // The nodes of two such meshes correspond: equilibria of one start the other, and symbolic work is shared.
        let near = self.all.iter().rev().find(|s| s.releases == releases);
        let states = near.map(|s| s.states.clone()).unwrap_or_default();
        let model = match near.filter(|_| releases == [false; 2]) {
            Some(near) => near.model.moved(as_made.nodes)?,
            None => ForwardModel::with_released(as_made, &made, &|_, is_moved| releases[usize::from(is_moved)])?,
        };
        if self.all.len() >= MAX_STATIONS {
            // The nominal one stays.
            self.all.remove(1);
        }
        self.all.push(Station { holes, releases, shape: scene.shape, drawn: mesh, model, view, pose, states });
        Ok(self.all.len() - 1)
    }

    /// Velocity of a station's nodes from one scene to another 2 `step` further, if holes or faces change.
    pub(super) fn node_velocity(&self, at: usize, [ahead, behind]: &[Scene; 2], step: f64) -> Option<Vec<[f64; 3]>> {
        let mut velocity: Option<Vec<[f64; 3]>> = None;
        let half_mm = half_extents_mm(&self.observed.specimen);
        let mut add = |rate: f64, of_node: &dyn Fn(usize) -> [f64; 3]| {
            let num = self.nominal.nodes.len();
            let sum = velocity.get_or_insert_with(|| vec![[0.0; 3]; num]);
            for (n, s) in sum.iter_mut().enumerate() {
                for (s, v) in s.iter_mut().zip(of_node(n)) {
                    *s += rate * v;
                }
            }
        };
        for (hole, (a, b)) in ahead.holes.iter().zip(&behind.holes).enumerate() {
            let rate = [0, 1, 2].map(|i| (a[i] - b[i]) / (2.0 * step));
            for (r, variable) in rate.into_iter().zip(hole_variables(hole)) {
                if r.abs() > 0.0 {
                    let v = shape_velocity(&self.nominal, &self.observed.specimen, variable);
                    add(r, &|n| v[n]);
                }
            }
        }
        let change = ahead.shape.plus(-1.0, &behind.shape);
        if !change.is_nominal() {
            // The map is linear in the faces' coefficients.
            let drawn = &self.all[at].drawn.nodes;
            add(0.5 / step, &|n| change.offset(half_mm, drawn[n]));
        }
        velocity
    }
}

/// Where the image is taken to lie in a view: with holes, whose walls cut voxels, turned to first order only, which
/// [`ImageChange`](super::scene::ImageChange) does.
fn seen_pose(made: &Specimen, scene: &Scene) -> Pose {
    let pose = scene.image.pose;
    if made.holes.is_empty() { pose } else { Pose { rotation_rad: [0.0; 3], ..pose } }
}

fn placing(pose: &Pose, shape: BlockShape) -> Placing {
    Placing { shift_mm: pose.shift_mm, rotation_rad: pose.rotation_rad, shape }
}

fn hole_variables(hole: usize) -> [DesignVariable; 3] {
    [DesignVariable::HoleDiameter(hole), DesignVariable::HoleX(hole), DesignVariable::HoleOther(hole)]
}
