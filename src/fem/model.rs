//! The forward model: a mesh made ready for solving, and the loops over its elements.

use super::departures::Prepared;
use super::element_data::{Direction, ElementInput, ElementOutput, ElementTables, MAX_GROUPS, MAX_NODES};
use super::error::{SolveError, StepFailure};
use super::kernel::Kernels;
use super::linear::LinearSystem;
use super::nested::Guide;
use super::topology::{NOT_FREE, Topology};
use crate::material::{LANES, Lanes, Ogden, Parameter};
use crate::mesh::Mesh;
use crate::specimen::{Specimen, TestKind};

/// A mesh made ready for solving: boundary conditions, elimination order, symbolic factorisation, workspace.
///
/// The moved plate or grip is displaced by the drive along x; the fixed one not at all.
pub struct ForwardModel {
    pub(super) mesh: Mesh,
    pub(super) tables: ElementTables,
    pub(super) kernels: Kernels,
    pub(super) topology: Topology,
    pub(super) system: LinearSystem,
    pub(super) output: Box<ElementOutput>,
    /// Per element: B, D and the pressure gap of the last assembly, from which the pressure follows after a solve.
    pub(super) condensation: Vec<Condensation>,
    /// Affine displacement along x per unit of drive at each node: the first guess of a load step.
    pub(super) lift: Vec<f64>,
    /// Elements with a node on the moved plate.
    pub(super) driven_elements: Vec<u32>,
    pub(super) is_moved: Vec<bool>,
    /// Nodes that move with a plate.
    pub(super) is_held: Vec<bool>,
    /// No departures: the coarse model for first guesses applies.
    pub(super) is_nominal: bool,
    /// Plate nodes that move under springs instead of with the plate.
    pub(super) is_released: Vec<bool>,
    /// Those nodes with the area of the face that they stand for, mm².
    pub(super) released: Vec<(u32, f64)>,
    /// Centres of the fixed and of the moved face, mm.
    pub(super) face_centers: [[f64; 3]; 2],
    /// Departures from the nominal experiment.
    pub(super) prepared: Prepared,
    /// Forces of the springs at the last assembly of the tangent.
    pub(super) spring_forces: Vec<(u32, [f64; 3])>,
    /// Reference positions of the quadrature points; empty until a field needs them.
    pub(super) point_positions: Vec<[[Lanes; MAX_GROUPS]; 3]>,
    /// Multiplicity of the meshed part (2 per mirror plane) × samples in parallel.
    pub(super) multiplicity: f64,
    /// Largest first load step, mm.
    pub(super) first_step_mm: f64,
    /// The equilibrium at which the stored tangent stands, if any.
    pub(super) tangent_at: u64,
    pub(super) statistics: Statistics,
    /// A coarse model for first guesses.
    pub(super) guide: Option<Box<Guide>>,
}

/// What the last solve took.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Statistics {
    /// Load steps accepted.
    pub load_steps: usize,
    /// Load steps that failed and were halved.
    pub failed_steps: usize,
    /// Newton iterations, failed steps included.
    pub newton_iterations: usize,
}

/// What is kept of an element between assembly and the update of its pressure.
pub(super) struct Condensation {
    divergence: [[[Lanes; MAX_GROUPS]; 3]; 4],
    pressure_gap: [f64; 4],
    bulk: [[f64; 4]; 4],
}

impl ForwardModel {
    /// Prepares `mesh` of `specimen`.
    ///
    /// # Errors
    /// [`SolveError::InvalidMesh`]; [`SolveError::Linear`] where memory does not suffice.
    pub fn new(mesh: Mesh, specimen: &Specimen) -> Result<Self, SolveError> {
        Self::with_released(mesh, specimen, &|_, _| false)
    }

    /// As [`Self::new`], with the nodes of the bonded faces for which `is_released`(position, whether on the moved face)
    /// held by springs, whose stiffness is [`super::Departures::bond_kpa_per_mm`].
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_released(
        mesh: Mesh,
        specimen: &Specimen,
        is_released: &dyn Fn([f64; 3], bool) -> bool,
    ) -> Result<Self, SolveError> {
        let areas = mesh.face_areas();
        let mut released = Vec::new();
        let mut flags = vec![false; mesh.nodes.len()];
        for (nodes, is_moved) in [(&mesh.fixed_nodes, false), (&mesh.moved_nodes, true)] {
            for &v in nodes.iter() {
                if is_released(mesh.nodes[v as usize], is_moved) {
                    flags[v as usize] = true;
                    released.push((v, areas[v as usize]));
                }
            }
        }
        let topology = Topology::new(&mesh, &flags);
        let system = LinearSystem::new(&topology)?;
        let mut is_moved = vec![false; mesh.nodes.len()];
        for &v in &mesh.moved_nodes {
            is_moved[v as usize] = true;
        }
        let mut is_held = is_moved.clone();
        for &v in &mesh.fixed_nodes {
            is_held[v as usize] = true;
        }
        for &(v, _) in &released {
            is_held[v as usize] = false;
        }
        let driven_elements = (0..mesh.num_elements() as u32)
            .filter(|&e| mesh.element(e as usize).iter().any(|&v| is_moved[v as usize]))
            .collect();
        let (axis, extent) = match specimen.test {
            TestKind::DoubleLapShear => (1, specimen.block.thickness_mm),
            TestKind::Uniaxial => (0, specimen.block.length_mm),
        };
        let lift = mesh.nodes.iter().map(|x| x[axis] / extent + 0.5).collect();
        let planes = u32::from(mesh.mirror.y) + u32::from(mesh.mirror.z);
        let num_elements = mesh.num_elements();
        let mut model = ForwardModel {
            tables: ElementTables::new(mesh.element_kind),
            kernels: Kernels::detect(),
            topology,
            system,
            output: Box::default(),
            condensation: (0..num_elements)
                .map(|_| Condensation {
                    divergence: [[[Lanes::ZERO; MAX_GROUPS]; 3]; 4],
                    pressure_gap: [0.0; 4],
                    bulk: [[0.0; 4]; 4],
                })
                .collect(),
            lift,
            driven_elements,
            is_moved,
            is_held,
            is_nominal: true,
            is_released: flags,
            released,
            face_centers: [-0.5, 0.5].map(|side| {
                let mut center = [0.0; 3];
                center[axis] = side * extent;
                center
            }),
            prepared: Prepared::default(),
            spring_forces: Vec::new(),
            point_positions: Vec::new(),
            multiplicity: f64::from(1u32 << planes) * f64::from(specimen.samples_in_parallel),
            // One step to a shear strain of 0.8 takes five or six iterations; stretching is more nonlinear.
            first_step_mm: if axis == 1 { 0.85 } else { 0.3 } * extent,
            tangent_at: 0,
            statistics: Statistics::default(),
            guide: None,
            mesh,
        };
        model.check_geometry()?;
        model.set_departures(&super::Departures::default());
        Ok(model)
    }

    /// The mesh.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// How often the meshed part stands in the test: mirrored copies times samples. Forces are those of all of them.
    pub fn multiplicity(&self) -> f64 {
        self.multiplicity
    }

    /// Displacement unknowns that can move.
    pub fn num_unknowns(&self) -> usize {
        self.topology.num_free_unknowns()
    }

    /// What the last solve took.
    pub fn statistics(&self) -> Statistics {
        self.statistics
    }

    /// Name of the instruction set in use.
    pub fn instruction_set(&self) -> &'static str {
        self.kernels.name
    }

    /// Uses the kernels without special instructions: for tests that compare them.
    pub fn use_portable_kernels(&mut self) {
        self.kernels = Kernels::portable();
    }

    fn check_geometry(&self) -> Result<(), SolveError> {
        let rest = vec![[0.0; 3]; self.mesh.nodes.len()];
        let material = Ogden { bulk_kpa: 1.0, terms: Vec::new() };
        let mut out = ElementOutput::default();
        for e in 0..self.mesh.num_elements() {
            let input = self.input(e, &self.mesh.nodes, &rest, None, &material);
            if !self.kernels.residual(&self.tables, &input, &mut out) {
                return Err(SolveError::InvalidMesh { element: e, jacobian: out.min_geometry_jacobian });
            }
        }
        Ok(())
    }

    /// Gathers the input of element `e`.
    pub(super) fn input<'a>(
        &'a self,
        e: usize,
        positions: &[[f64; 3]],
        displacements: &[[f64; 3]],
        pressure: Option<&[[f64; 4]]>,
        material: &'a Ogden,
    ) -> ElementInput<'a> {
        let input = self.nominal_input(e, positions, displacements, pressure, material);
        ElementInput {
            stiffness_factor: self.prepared.factor.get(e),
            log_growth: self.prepared.growth.get(e),
            fibre: self.prepared.departures.fibre,
            ..input
        }
    }

    /// As [`Self::input`], without departures.
    pub(super) fn nominal_input<'a>(
        &self,
        e: usize,
        positions: &[[f64; 3]],
        displacements: &[[f64; 3]],
        pressure: Option<&[[f64; 4]]>,
        material: &'a Ogden,
    ) -> ElementInput<'a> {
        let mut input = ElementInput {
            positions: [[0.0; 3]; MAX_NODES],
            displacements: [[0.0; 3]; MAX_NODES],
            pressure: pressure.map(|p| p[e]),
            material,
            stiffness_factor: None,
            log_growth: None,
            fibre: None,
        };
        for (a, &v) in self.mesh.element(e).iter().enumerate() {
            input.positions[a] = positions[v as usize];
            input.displacements[a] = displacements[v as usize];
        }
        input
    }

    /// Condensed residual at every node (plates included) with nodes at `positions` and the condensed pressure;
    /// `elements` restricts the loop.
    pub(super) fn assemble_residual_at(
        &mut self,
        material: &Ogden,
        positions: &[[f64; 3]],
        displacement: &[[f64; 3]],
        elements: Option<&[u32]>,
        residual: &mut [[f64; 3]],
    ) -> Result<(), StepFailure> {
        residual.fill([0.0; 3]);
        let mut out = std::mem::take(&mut self.output);
        let result = self.each_element(elements, |e| {
            let input = self.input(e, positions, displacement, None, material);
            if !self.kernels.residual(&self.tables, &input, &mut out) {
                return Err(StepFailure::InvertedElement { element: e, jacobian: out.min_jacobian });
            }
            scatter(self.mesh.element(e), &out.residual, residual);
            Ok(())
        });
        self.output = out;
        result
    }

    fn each_element(
        &self,
        elements: Option<&[u32]>,
        mut work: impl FnMut(usize) -> Result<(), StepFailure>,
    ) -> Result<(), StepFailure> {
        match elements {
            Some(list) => list.iter().try_for_each(|&e| work(e as usize)),
            None => (0..self.mesh.num_elements()).try_for_each(work),
        }
    }

    /// Residual and tangent stiffness; keeps what the pressure update needs.
    pub(super) fn assemble_tangent(
        &mut self,
        material: &Ogden,
        drive_mm: f64,
        displacement: &[[f64; 3]],
        pressure: Option<&[[f64; 4]]>,
        residual: &mut [[f64; 3]],
    ) -> Result<(), StepFailure> {
        residual.fill([0.0; 3]);
        self.tangent_at = 0;
        self.system.blocks.fill([0.0; 9]);
        let mut out = std::mem::take(&mut self.output);
        let mut failure = None;
        for index in 0..self.mesh.num_elements() {
            let e = self.topology.element_order[index] as usize;
            let input = self.input(e, &self.mesh.nodes, displacement, pressure, material);
            if !self.kernels.tangent(&self.tables, &input, &mut out) {
                failure = Some(StepFailure::InvertedElement { element: e, jacobian: out.min_jacobian });
                break;
            }
            scatter(self.mesh.element(e), &out.residual, residual);
            let kept = &mut self.condensation[e];
            kept.pressure_gap = out.pressure_gap;
            kept.bulk = out.bulk;
            for m in 0..4 {
                kept.divergence[m] = out.divergence[m];
            }
            self.scatter_stiffness(e, &out);
        }
        self.output = out;
        if let Some(failure) = failure {
            return Err(failure);
        }
        self.spring_forces = self.add_spring_forces(drive_mm, displacement, residual);
        self.add_spring_stiffness();
        self.pin();
        Ok(())
    }

    fn scatter_stiffness(&mut self, e: usize, out: &ElementOutput) {
        let nodes = self.mesh.element(e);
        let n = nodes.len();
        let mut places = [NOT_FREE; MAX_NODES];
        for (place, &v) in places.iter_mut().zip(nodes) {
            *place = self.topology.place[v as usize];
        }
        let mut pairs = self.topology.pair_blocks(e);
        for b in 0..n {
            let (now, rest) = pairs.split_at(n - b);
            pairs = rest;
            if places[b] == NOT_FREE {
                continue;
            }
            let columns = &out.stiffness[3 * b..3 * b + 3];
            for (a, &block) in (b..n).zip(now) {
                if places[a] == NOT_FREE {
                    continue;
                }
                let (group, lane) = (a / LANES, a % LANES);
                let target = &mut self.system.blocks[block as usize];
                if places[a] >= places[b] {
                    for k in 0..3 {
                        for i in 0..3 {
                            target[3 * k + i] += columns[k][i][group].0[lane];
                        }
                    }
                } else {
                    for k in 0..3 {
                        for i in 0..3 {
                            target[3 * k + i] += columns[i][k][group].0[lane];
                        }
                    }
                }
            }
        }
    }

    /// Replaces rows and columns of pinned unknowns by their diagonal.
    fn pin(&mut self) {
        let t = &self.topology;
        for (j, pair) in t.block_pointers.windows(2).enumerate() {
            for s in pair[0] as usize..pair[1] as usize {
                let row = t.block_rows[s] as usize;
                let block = &mut self.system.blocks[s];
                for k in 0..3 {
                    for i in 0..3 {
                        let is_diagonal = row == j && i == k;
                        if !is_diagonal && (t.is_pinned[3 * j + k] || t.is_pinned[3 * row + i]) {
                            block[3 * k + i] = 0.0;
                        }
                    }
                }
            }
        }
    }

    /// δp of every element from δu: D B δu + gap, with the B and D of the last tangent.
    pub(super) fn pressure_update(&self, delta: &[[f64; 3]]) -> Vec<[f64; 4]> {
        let mut update = Vec::with_capacity(self.condensation.len());
        for (e, kept) in self.condensation.iter().enumerate() {
            let nodes = self.mesh.element(e);
            let mut p = kept.pressure_gap;
            for m in 0..4 {
                let mut dilation = 0.0;
                for (a, &v) in nodes.iter().enumerate() {
                    let d = &delta[v as usize];
                    for i in 0..3 {
                        dilation += kept.divergence[m][i][a / LANES].0[a % LANES] * d[i];
                    }
                }
                for (n, p) in p.iter_mut().enumerate() {
                    *p += kept.bulk[n][m] * dilation;
                }
            }
            update.push(p);
        }
        update
    }

    /// Directional derivative of the condensed residual, summed at the nodes; `elements` restricts the loop.
    pub(super) fn assemble_directional(
        &mut self,
        material: &Ogden,
        positions: &[[f64; 3]],
        displacement: &[[f64; 3]],
        direction: Option<&[[f64; 3]]>,
        parameter: Option<Parameter>,
        elements: Option<&[u32]>,
        derivative: &mut [[f64; 3]],
    ) -> Result<(), StepFailure> {
        derivative.fill([0.0; 3]);
        let mut out = std::mem::take(&mut self.output);
        let result = self.each_element(elements, |e| {
            let input = self.input(e, positions, displacement, None, material);
            let displacements = direction.map(|nodal| {
                let mut local = [[0.0; 3]; MAX_NODES];
                for (a, &v) in self.mesh.element(e).iter().enumerate() {
                    local[a] = nodal[v as usize];
                }
                local
            });
            let d = Direction { displacements, parameter };
            if !self.kernels.directional(&self.tables, &input, &d, &mut out) {
                return Err(StepFailure::InvertedElement { element: e, jacobian: out.min_jacobian });
            }
            scatter(self.mesh.element(e), &out.residual, derivative);
            Ok(())
        });
        self.output = out;
        result
    }

    /// Collects a nodal vector into the unknowns (pinned ones zero), times `sign`.
    pub(super) fn collect(&self, nodal: &[[f64; 3]], sign: f64) -> Vec<f64> {
        let t = &self.topology;
        let mut x = vec![0.0; t.num_unknowns()];
        for (k, &v) in t.node_at.iter().enumerate() {
            for i in 0..3 {
                if !t.is_pinned[3 * k + i] {
                    x[3 * k + i] = sign * nodal[v as usize][i];
                }
            }
        }
        x
    }

    /// Spreads unknowns to the nodes; plates get zero.
    pub(super) fn spread(&self, x: &[f64]) -> Vec<[f64; 3]> {
        let mut nodal = vec![[0.0; 3]; self.mesh.nodes.len()];
        for (k, &v) in self.topology.node_at.iter().enumerate() {
            nodal[v as usize] = [x[3 * k], x[3 * k + 1], x[3 * k + 2]];
        }
        nodal
    }

    /// Sum of nodal forces over the moved plate, kPa·mm², of the meshed part.
    pub(super) fn reaction(&self, residual: &[[f64; 3]]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for &v in &self.mesh.moved_nodes {
            for i in 0..3 {
                sum[i] += residual[v as usize][i];
            }
        }
        sum
    }
}

/// Adds an element's nodal vector.
pub(super) fn scatter(nodes: &[u32], local: &[[f64; 3]; MAX_NODES], global: &mut [[f64; 3]]) {
    for (a, &v) in nodes.iter().enumerate() {
        for i in 0..3 {
            global[v as usize][i] += local[a][i];
        }
    }
}
