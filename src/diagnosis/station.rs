//! Prepared models: one per block as made and per set of released faces, each with how the scan sees it.

use super::error::DiagnosisError;
use super::scene::{MovedCut, Pose, Scene};
use crate::calibration::{Observed, Placing, View};
use crate::fem::{Departures, Equilibrium, ForwardModel, PrepareError};
use crate::mesh::{
    BlockShape, DesignVariable, Mesh, MeshOptions, cut_offset, half_extents_mm, made_mesh, mesh_cut_specimen, morphed,
    shape_velocity,
};
use crate::specimen::Specimen;
use std::sync::Arc;

/// Most prepared models kept: one nominal, some with released faces, other holes or faces.
const MAX_STATIONS: usize = 4;
/// Element size of the mesh of a sample with a cut, as a factor on the nominal mesh's, whose error it is to be without:
/// its triangles err otherwise.
const CUT_FACTOR: f64 = 0.6;
/// Cut meshes are no finer than this, as a factor on the standard size.
const FINEST_CUT: f64 = 0.9;

/// A prepared model: one mesh, one set of released faces.
pub(super) struct Station {
    holes: Vec<[f64; 3]>,
    releases: [bool; 2],
    shape: BlockShape,
    cut: Option<MovedCut>,
    /// The mesh of the specimen as drawn, with the cut where it was meshed.
    base: Arc<Mesh>,
    /// The mesh of the drawn block with the holes and the cut as they are.
    drawn: Arc<Mesh>,
    /// Of the block as made.
    pub(super) model: ForwardModel,
    /// Of the image as it lies.
    pub(super) view: Arc<View>,
    pose: Pose,
    /// The last equilibria, from which the next start.
    pub(super) states: Vec<Equilibrium>,
}

impl Station {
    /// The same for work beside it: what it prepared is shared, and what either solves the other does not see.
    fn twin(&self) -> Station {
        Station {
            holes: self.holes.clone(),
            base: self.base.clone(),
            drawn: self.drawn.clone(),
            model: self.model.departed(&Departures::default()),
            view: self.view.clone(),
            pose: self.pose,
            states: self.states.clone(),
            ..*self
        }
    }

    /// Where the view takes the image to lie.
    pub(super) fn pose(&self) -> &Pose {
        &self.pose
    }
}

/// The prepared models of one recording.
pub(super) struct Stations<'a> {
    observed: &'a Observed,
    options: MeshOptions,
    nominal: Arc<Mesh>,
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
    /// None yet; `nominal` is the mesh of the specimen as drawn, made with `options`.
    pub(super) fn new(observed: &'a Observed, nominal: Mesh, options: MeshOptions) -> Stations<'a> {
        Stations { observed, options, nominal: Arc::new(nominal), all: Vec::new() }
    }

    /// The mesh of the specimen as drawn.
    pub(super) fn nominal(&self) -> &Mesh {
        &self.nominal
    }

    /// The same for work beside them.
    pub(super) fn twin(&self) -> Stations<'a> {
        Stations { nominal: self.nominal.clone(), all: self.all.iter().map(Station::twin).collect(), ..*self }
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
        let is_found =
            |s: &Station| s.releases == releases && s.shape == scene.shape && s.cut == scene.cut && same_holes(s);
        let found = self.all.iter().position(is_found);
        if let Some(at) = found {
            let station = &mut self.all[at];
            if station.pose != pose {
                let view = self.observed.placed_view(&made, &station.drawn, &placing(&pose, scene.shape))?;
                station.view = Arc::new(view);
                station.pose = pose;
            }
            return Ok(at);
        }
        made.validate().map_err(DiagnosisError::Specimen)?;
        let base = self.base_of(scene)?;
        let mut mesh = Mesh::clone(&base);
        for (hole, change) in holes.iter().enumerate() {
            for (variable, component) in hole_variables(drawn, hole) {
                let by = change[component];
                if by.abs() > 0.0 {
                    let velocity = shape_velocity(&base, drawn, variable);
                    mesh = morphed(&mesh, &velocity, by);
                }
            }
        }
        if let Some(MovedCut { meshed, cut }) = &scene.cut {
            let offsets: Vec<[f64; 3]> = base.nodes.iter().map(|x| cut_offset(drawn, meshed, cut, *x)).collect();
            mesh = morphed(&mesh, &offsets, 1.0);
        }
        let view = self.observed.placed_view(&made, &mesh, &placing(&pose, scene.shape))?;
        let as_made = made_mesh(&mesh, drawn, &scene.shape);
        // The nodes of two such meshes correspond: equilibria of one start the other, and symbolic work is shared.
        let near = self.all.iter().rev().find(|s| s.releases == releases && Arc::ptr_eq(&s.base, &base));
        let states = near.map(|s| s.states.clone()).unwrap_or_default();
        let model = match near.filter(|_| releases == [false; 2]) {
            Some(near) => near.model.moved(as_made.nodes)?,
            None => ForwardModel::with_released(as_made, &made, &|_, is_moved| releases[usize::from(is_moved)])?,
        };
        if self.all.len() >= MAX_STATIONS {
            // The nominal one stays.
            self.all.remove(1);
        }
        let (shape, cut) = (scene.shape, scene.cut);
        let (drawn, view) = (Arc::new(mesh), Arc::new(view));
        self.all.push(Station { holes, releases, shape, cut, base, drawn, model, view, pose, states });
        Ok(self.all.len() - 1)
    }

    /// The mesh of the specimen as drawn, with the cut of a scene where it was meshed.
    fn base_of(&self, scene: &Scene) -> Result<Arc<Mesh>, DiagnosisError> {
        let Some(MovedCut { meshed, .. }) = &scene.cut else { return Ok(self.nominal.clone()) };
        let has_it = |s: &&Station| s.cut.is_some_and(|c| c.meshed == *meshed);
        if let Some(station) = self.all.iter().find(has_it) {
            return Ok(station.base.clone());
        }
        let options = self.options.refined_by(CUT_FACTOR, &self.observed.specimen, FINEST_CUT);
        let mesh = mesh_cut_specimen(&self.observed.specimen, &options, meshed).map_err(PrepareError::from)?;
        Ok(Arc::new(mesh))
    }

    /// Velocity of a station's nodes from one scene to another 2 `step` further, if holes or faces change.
    pub(super) fn node_velocity(&self, at: usize, [ahead, behind]: &[Scene; 2], step: f64) -> Option<Vec<[f64; 3]>> {
        let mut velocity: Option<Vec<[f64; 3]>> = None;
        let half_mm = half_extents_mm(&self.observed.specimen);
        let mut add = |rate: f64, of_node: &dyn Fn(usize) -> [f64; 3]| {
            let num = self.all[at].base.nodes.len();
            let sum = velocity.get_or_insert_with(|| vec![[0.0; 3]; num]);
            for (n, s) in sum.iter_mut().enumerate() {
                for (s, v) in s.iter_mut().zip(of_node(n)) {
                    *s += rate * v;
                }
            }
        };
        for (hole, (a, b)) in ahead.holes.iter().zip(&behind.holes).enumerate() {
            let rate = [0, 1, 2].map(|i| (a[i] - b[i]) / (2.0 * step));
            for (variable, component) in hole_variables(&self.observed.specimen, hole) {
                let r = rate[component];
                if r.abs() > 0.0 {
                    let v = shape_velocity(&self.all[at].base, &self.observed.specimen, variable);
                    add(r, &|n| v[n]);
                }
            }
        }
        if let (Some(a), Some(b)) = (&ahead.cut, &behind.cut)
            && a != b
        {
            let (specimen, base) = (&self.observed.specimen, &self.all[at].base.nodes);
            let offset = |c: &MovedCut, n: usize| cut_offset(specimen, &c.meshed, &c.cut, base[n]);
            add(0.5 / step, &|n| {
                let (a, b) = (offset(a, n), offset(b, n));
                [0, 1, 2].map(|i| a[i] - b[i])
            });
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

fn hole_variables(drawn: &Specimen, hole: usize) -> Vec<(DesignVariable, usize)> {
    use DesignVariable as V;
    let mut variables = vec![(V::HoleDiameter(hole), 0), (V::HoleX(hole), 1), (V::HoleOther(hole), 2)];
    if drawn.holes.get(hole).is_some_and(|h| h.shape.is_some()) {
        // Its wall moves out all around.
        variables.push((V::HoleLength(hole), 0));
    }
    variables
}
