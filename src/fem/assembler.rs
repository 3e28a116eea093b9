//! The assembler: what turns a state of a mesh into a residual, a tangent and their derivatives.
//!
//! It owns no matrix and remembers no state. Copies share the mesh, the topology and the departures, so that an
//! assembler of other departures ([`Assembler::departed`]) is a value beside the first one.

use super::condensation::Condensation;
use super::crew::{Crew, Seat};
use super::departures::Departures;
use super::departures_on_mesh::{DeparturesOnMesh, PointPositions};
use super::element_data::{ElementInput, ElementOutput, ElementTables, MAX_GROUPS, MAX_NODES};
use super::equilibrium::Equilibrium;
use super::error::{SolveError, StepFailure};
use super::kernels::Kernels;
use super::linearisation::Linearisation;
use super::plates::Plates;
use super::rates::Rates;
use super::topology::Topology;
use crate::material::{Lanes, Material, Parameter};
use crate::mesh::Mesh;
use crate::specimen::Specimen;
use std::sync::{Arc, OnceLock};

/// What does not change with the departures: the mesh with its boundary conditions and unknowns.
struct Discretisation {
    mesh: Mesh,
    tables: Arc<ElementTables>,
    topology: Arc<Topology>,
    plates: Arc<Plates>,
    /// Multiplicity of the meshed part (2 per mirror plane) × samples in parallel.
    multiplicity: f64,
    /// Reference positions of the quadrature points of every element; made when a field first needs them.
    points: OnceLock<Vec<PointPositions>>,
}

/// Turns a state of one mesh, under given departures, into nodal vectors and matrices.
#[derive(Clone)]
pub(super) struct Assembler {
    discretisation: Arc<Discretisation>,
    departures: Arc<DeparturesOnMesh>,
    kernels: Kernels,
}

/// Elements whose tangents a thread works out at once: what they give stays in its cache until its turn comes.
const TANGENTS_AT_ONCE: usize = 2;
/// The same of residuals.
const RESIDUALS_AT_ONCE: usize = 8;
/// Fewer turns are not worth the time that it takes to call for help.
const TURNS_WORTH_HELP: usize = 32;

/// Where an element vector is evaluated.
#[derive(Clone, Copy)]
pub(super) struct Configuration<'a> {
    /// The material.
    pub(super) material: &'a Material,
    /// Reference position of each node, mm.
    pub(super) positions: &'a [[f64; 3]],
    /// Displacement of each node, mm.
    pub(super) displacement: &'a [[f64; 3]],
}

/// A material of which only the geometry of elements at rest is asked.
fn any_material() -> Material {
    Material { bulk_kpa: 1.0, terms: Vec::new(), law: None }
}

impl Assembler {
    /// For `mesh` of `specimen` without departures; `is_released`(position, whether on the moved face) says which nodes
    /// of the bonded faces are held by springs.
    ///
    /// # Errors
    /// [`SolveError::InvalidMesh`].
    pub(super) fn new(
        mesh: Mesh,
        specimen: &Specimen,
        is_released: &dyn Fn([f64; 3], bool) -> bool,
    ) -> Result<Assembler, SolveError> {
        let plates = Plates::new(&mesh, specimen, is_released);
        let topology = Arc::new(Topology::new(&mesh, &plates.is_released));
        let planes = u32::from(mesh.mirror.y) + u32::from(mesh.mirror.z);
        let departures = DeparturesOnMesh::new(&Departures::default(), &mesh, &plates, &|| &[]);
        let assembler = Assembler {
            discretisation: Arc::new(Discretisation {
                tables: Arc::new(ElementTables::new(mesh.element_kind)),
                topology,
                plates: Arc::new(plates),
                multiplicity: f64::from(1u32 << planes) * f64::from(specimen.samples_in_parallel),
                points: OnceLock::new(),
                mesh,
            }),
            departures: Arc::new(departures),
            kernels: Kernels::detect(),
        };
        assembler.check_geometry()?;
        Ok(assembler)
    }

    /// The same mesh with other departures. Only their fields are evaluated; all else is shared.
    pub(super) fn departed(&self, departures: &Departures) -> Assembler {
        let points = || &self.discretisation.points.get_or_init(|| self.point_positions())[..];
        let on_mesh = DeparturesOnMesh::new(departures, self.mesh(), self.plates(), &points);
        Assembler { departures: Arc::new(on_mesh), ..self.clone() }
    }

    /// The same elements with the nodes elsewhere, without departures. Springs keep the areas that they stood for.
    ///
    /// # Errors
    /// [`SolveError::InvalidMesh`].
    pub(super) fn moved(&self, nodes: Vec<[f64; 3]>) -> Result<Assembler, SolveError> {
        let old = &self.discretisation;
        let mesh = Mesh { nodes, ..old.mesh.clone() };
        let departures = DeparturesOnMesh::new(&Departures::default(), &mesh, &old.plates, &|| &[]);
        let assembler = Assembler {
            discretisation: Arc::new(Discretisation {
                tables: old.tables.clone(),
                topology: old.topology.clone(),
                plates: old.plates.clone(),
                multiplicity: old.multiplicity,
                points: OnceLock::new(),
                mesh,
            }),
            departures: Arc::new(departures),
            kernels: self.kernels,
        };
        assembler.check_geometry()?;
        Ok(assembler)
    }

    /// The same sample while its plates are brought to where they are before any drive; what drives them here is the
    /// precompression.
    pub(super) fn pressing(&self) -> Assembler {
        let old = &self.discretisation;
        let pressing = Assembler {
            discretisation: Arc::new(Discretisation {
                mesh: old.mesh.clone(),
                tables: old.tables.clone(),
                topology: old.topology.clone(),
                plates: Arc::new(old.plates.pressing()),
                multiplicity: old.multiplicity,
                points: OnceLock::new(),
            }),
            ..self.clone()
        };
        pressing.departed(&self.departures().before_drive())
    }

    /// The same with the kernels that use no special instructions.
    pub(super) fn portable(&self) -> Assembler {
        Assembler { kernels: Kernels::portable(), ..self.clone() }
    }

    pub(super) fn mesh(&self) -> &Mesh {
        &self.discretisation.mesh
    }

    pub(super) fn tables(&self) -> &ElementTables {
        &self.discretisation.tables
    }

    pub(super) fn kernels(&self) -> &Kernels {
        &self.kernels
    }

    pub(super) fn topology(&self) -> &Arc<Topology> {
        &self.discretisation.topology
    }

    pub(super) fn plates(&self) -> &Plates {
        &self.discretisation.plates
    }

    /// The departures in force.
    pub(super) fn departures(&self) -> &Departures {
        &self.departures.departures
    }

    /// Per element: the factor on the stiffness at the quadrature points. Empty where there is none.
    pub(super) fn stiffness_factors(&self) -> &[[Lanes; MAX_GROUPS]] {
        &self.departures.factor
    }

    /// Per element: ln of the volume ratio free of pressure at the quadrature points. Empty where there is none.
    pub(super) fn log_growths(&self) -> &[[Lanes; MAX_GROUPS]] {
        &self.departures.growth
    }

    /// How often the meshed part stands in the test.
    pub(super) fn multiplicity(&self) -> f64 {
        self.discretisation.multiplicity
    }

    /// Displacement (mm) that the plates impose on node `v`, which must be on a plate.
    pub(super) fn imposed(&self, v: usize, drive_mm: f64) -> [f64; 3] {
        self.plates().imposed(self.mesh().nodes[v], self.departures(), v, drive_mm)
    }

    fn check_geometry(&self) -> Result<(), SolveError> {
        let material = any_material();
        let rest = vec![[0.0; 3]; self.mesh().nodes.len()];
        let at = Configuration { material: &material, positions: &self.mesh().nodes, displacement: &rest };
        let mut out = ElementOutput::default();
        for e in 0..self.mesh().num_elements() {
            if !self.kernels.residual(self.tables(), &self.input(e, &at, None), &mut out) {
                return Err(SolveError::InvalidMesh { element: e, jacobian: out.min_geometry_jacobian });
            }
        }
        Ok(())
    }

    fn point_positions(&self) -> Vec<PointPositions> {
        let material = any_material();
        let rest = vec![[0.0; 3]; self.mesh().nodes.len()];
        let at = Configuration { material: &material, positions: &self.mesh().nodes, displacement: &rest };
        let mut out = ElementOutput::default();
        (0..self.mesh().num_elements())
            .map(|e| {
                self.kernels.residual(self.tables(), &gathered(self.mesh(), e, &at, None), &mut out);
                out.points
            })
            .collect()
    }

    /// Gathers the input of element `e`; pressures are the condensed ones where none are given.
    pub(super) fn input<'a>(
        &'a self,
        e: usize,
        at: &Configuration<'a>,
        pressure: Option<&[[f64; 4]]>,
    ) -> ElementInput<'a> {
        ElementInput {
            stiffness_factor: self.departures.factor.get(e),
            log_growth: self.departures.growth.get(e),
            fibre: self.departures().fibre,
            law: self.departures().law,
            ..gathered(self.mesh(), e, at, pressure)
        }
    }

    /// Condensed residual (kPa·mm²) at every node, plates included and springs left out, with the condensed pressure;
    /// `elements` restricts the sum.
    pub(super) fn assemble_residual(
        &self,
        at: &Configuration,
        elements: Option<&[u32]>,
        residual: &mut [[f64; 3]],
    ) -> Result<(), StepFailure> {
        self.sum_over_elements(elements, residual, |e, out| {
            self.kernels.residual(self.tables(), &self.input(e, at, None), out)
        })
    }

    /// Directional derivative of the condensed residual, per node: along `direction` (mm at each node) and with
    /// `parameter` moving by 1; `elements` restricts the sum.
    pub(super) fn assemble_directional(
        &self,
        at: &Configuration,
        direction: Option<&[[f64; 3]]>,
        parameter: Option<Parameter>,
        elements: Option<&[u32]>,
        derivative: &mut [[f64; 3]],
    ) -> Result<(), StepFailure> {
        let rates = Rates { displacement: direction, parameter, ..Rates::default() };
        let mut found = self.assemble_rates(at, &[rates], elements)?;
        derivative.copy_from_slice(&found.swap_remove(0));
        Ok(())
    }

    /// Derivatives of the condensed residual, per node, along each of `rates`, springs left out; `elements` restricts
    /// the sum.
    pub(super) fn assemble_rates(
        &self,
        at: &Configuration,
        rates: &[Rates],
        elements: Option<&[u32]>,
    ) -> Result<Vec<Vec<[f64; 3]>>, StepFailure> {
        let mut sums = vec![vec![[0.0; 3]; self.mesh().nodes.len()]; rates.len()];
        let mut out = ElementOutput::default();
        let mut found = vec![[[0.0; 3]; MAX_NODES]; rates.len()];
        let (mut places, mut variations) = (Vec::new(), Vec::new());
        let mut add = |e: usize| {
            places.clear();
            variations.clear();
            for (place, rates) in rates.iter().enumerate() {
                if let Some(variation) = rates.of_element(e, self.mesh().element(e)) {
                    places.push(place);
                    variations.push(variation);
                }
            }
            if places.is_empty() {
                return Ok(());
            }
            if !self.kernels.variations(self.tables(), &self.input(e, at, None), &variations, &mut out, &mut found) {
                return Err(StepFailure::InvertedElement { element: e, jacobian: out.min_jacobian });
            }
            for (&place, local) in places.iter().zip(&found) {
                scatter(self.mesh().element(e), local, &mut sums[place]);
            }
            Ok(())
        };
        match elements {
            Some(list) => list.iter().try_for_each(|&e| add(e as usize)),
            None => (0..self.mesh().num_elements()).try_for_each(add),
        }?;
        Ok(sums)
    }

    /// Sums the nodal vectors that `evaluate` leaves in the output of each element; it returns false where the element
    /// is inverted.
    fn sum_over_elements(
        &self,
        elements: Option<&[u32]>,
        sum: &mut [[f64; 3]],
        evaluate: impl Fn(usize, &mut ElementOutput) -> bool,
    ) -> Result<(), StepFailure> {
        sum.fill([0.0; 3]);
        let mut out = ElementOutput::default();
        let mut add = |e: usize| {
            if !evaluate(e, &mut out) {
                return Err(StepFailure::InvertedElement { element: e, jacobian: out.min_jacobian });
            }
            scatter(self.mesh().element(e), &out.residual, sum);
            Ok(())
        };
        match elements {
            Some(list) => list.iter().try_for_each(|&e| add(e as usize)),
            None => (0..self.mesh().num_elements()).try_for_each(add),
        }
    }

    /// Evaluates all elements in the order of assembly, `at_once` on a thread and with the help of whoever is idle, and
    /// commits them in that order; `evaluate` returns false where the element is inverted.
    fn in_turn(
        &self,
        at_once: usize,
        evaluate: &(dyn Fn(usize, &mut ElementOutput) -> bool + Sync),
        mut commit: impl FnMut(usize, &ElementOutput) + Send,
    ) -> Result<(), StepFailure> {
        let order = &self.topology().element_order;
        let num = order.len().div_ceil(at_once);
        let elements = |index: usize| order[index * at_once..].iter().take(at_once).map(|&e| e as usize);
        let _seat = Seat::take();
        let crew = if num < TURNS_WORTH_HELP { Crew::alone() } else { Crew::gather() };
        crew.in_turn(
            num,
            || (0..at_once).map(|_| ElementOutput::default()).collect::<Vec<_>>(),
            |outs, index| {
                for (e, out) in elements(index).zip(outs) {
                    if !evaluate(e, out) {
                        return Err(StepFailure::InvertedElement { element: e, jacobian: out.min_jacobian });
                    }
                }
                Ok(())
            },
            |outs, index| elements(index).zip(outs).for_each(|(e, out)| commit(e, out)),
        )
    }

    /// Residual and tangent stiffness at `state`, whose pressure is an independent iterate.
    ///
    /// # Errors
    /// [`StepFailure::InvertedElement`]; the linearisation is then of no use.
    pub(super) fn linearise(
        &self,
        material: &Material,
        state: &Equilibrium,
        into: &mut Linearisation,
    ) -> Result<(), StepFailure> {
        let mesh = self.mesh();
        let at = Configuration { material, positions: &mesh.nodes, displacement: &state.displacement };
        (into.stands_at, into.has_tangent) = (None, false);
        into.residual.clear();
        into.residual.resize(mesh.nodes.len(), [0.0; 3]);
        into.condensation.resize(mesh.num_elements(), Condensation::empty());
        let blocks = into.system.zeroed_blocks();
        let (residual, condensation) = (&mut into.residual, &mut into.condensation);
        let evaluate = |e: usize, out: &mut ElementOutput| {
            self.kernels.tangent(self.tables(), &self.input(e, &at, Some(&state.pressure)), out)
        };
        self.in_turn(TANGENTS_AT_ONCE, &evaluate, |e, out| {
            scatter(mesh.element(e), &out.residual, residual);
            condensation[e].keep(out);
            self.topology().add_element(e, mesh.element(e), &out.stiffness, blocks);
        })?;
        self.add_spring_stiffness(blocks);
        self.topology().pin(blocks);
        into.spring_forces = self.add_spring_forces(state.drive_mm, &state.displacement, &mut into.residual);
        into.has_tangent = true;
        Ok(())
    }

    /// As [`Self::linearise`], the residual alone: the tangent stays that of an earlier state.
    ///
    /// # Errors
    /// [`StepFailure::InvertedElement`]; the residual is then of no use.
    pub(super) fn evaluate(
        &self,
        material: &Material,
        state: &Equilibrium,
        into: &mut Linearisation,
    ) -> Result<(), StepFailure> {
        let mesh = self.mesh();
        let at = Configuration { material, positions: &mesh.nodes, displacement: &state.displacement };
        (into.stands_at, into.has_tangent) = (None, false);
        into.residual.fill([0.0; 3]);
        let (residual, condensation) = (&mut into.residual, &mut into.condensation);
        let evaluate = |e: usize, out: &mut ElementOutput| {
            self.kernels.residual(self.tables(), &self.input(e, &at, Some(&state.pressure)), out)
        };
        self.in_turn(RESIDUALS_AT_ONCE, &evaluate, |e, out| {
            scatter(mesh.element(e), &out.residual, residual);
            condensation[e].keep_gap(out);
        })?;
        into.spring_forces = self.add_spring_forces(state.drive_mm, &state.displacement, &mut into.residual);
        Ok(())
    }

    /// Adds the springs of released nodes to a residual; returns their forces (kPa·mm²), node by node.
    pub(super) fn add_spring_forces(
        &self,
        drive_mm: f64,
        displacement: &[[f64; 3]],
        residual: &mut [[f64; 3]],
    ) -> Vec<(u32, [f64; 3])> {
        self.departures
            .springs
            .iter()
            .map(|&(v, stiffness)| {
                let v_index = v as usize;
                let imposed = self.imposed(v_index, drive_mm);
                let force = [0, 1, 2].map(|i| stiffness * (displacement[v_index][i] - imposed[i]));
                for i in 0..3 {
                    residual[v_index][i] += force[i];
                }
                (v, force)
            })
            .collect()
    }

    /// Adds the springs to the diagonal of a tangent.
    fn add_spring_stiffness(&self, blocks: &mut [[f64; 9]]) {
        let topology = self.topology();
        for &(v, stiffness) in &self.departures.springs {
            let place = topology.place[v as usize];
            let Some(&block) = topology.block_pointers.get(place as usize) else { continue };
            // The diagonal block comes first in its column.
            let target = &mut blocks[block as usize];
            for i in 0..3 {
                target[4 * i] += stiffness;
            }
        }
    }

    /// Collects a nodal vector into the unknowns (pinned ones zero), times `sign`.
    pub(super) fn collect(&self, nodal: &[[f64; 3]], sign: f64) -> Vec<f64> {
        let t = self.topology();
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
        let mut nodal = vec![[0.0; 3]; self.mesh().nodes.len()];
        for (k, &v) in self.topology().node_at.iter().enumerate() {
            nodal[v as usize] = [x[3 * k], x[3 * k + 1], x[3 * k + 2]];
        }
        nodal
    }

    /// Sum of nodal forces over the moved plate, kPa·mm², of the meshed part.
    pub(super) fn reaction(&self, residual: &[[f64; 3]]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for &v in &self.mesh().moved_nodes {
            for i in 0..3 {
                sum[i] += residual[v as usize][i];
            }
        }
        sum
    }

    /// Forces (N) of the whole test on the moved plate, in the direction of the drive and along +y, of what the meshed
    /// part puts on it (kPa·mm²). Where y is a mirror, the parts' forces along it cancel.
    pub(super) fn forces_n(&self, reaction: [f64; 3]) -> [f64; 2] {
        let across = if self.mesh().mirror.y { 0.0 } else { reaction[1] };
        // kPa·mm² = 10⁻³ N.
        [self.plates().along(reaction), across].map(|force| force * self.multiplicity() * 1e-3)
    }
}

/// The input of element `e` without departures.
fn gathered<'a>(mesh: &Mesh, e: usize, at: &Configuration<'a>, pressure: Option<&[[f64; 4]]>) -> ElementInput<'a> {
    let mut input = ElementInput {
        positions: [[0.0; 3]; MAX_NODES],
        displacements: [[0.0; 3]; MAX_NODES],
        pressure: pressure.map(|p| p[e]),
        material: at.material,
        stiffness_factor: None,
        log_growth: None,
        fibre: None,
        law: None,
    };
    for (a, &v) in mesh.element(e).iter().enumerate() {
        input.positions[a] = at.positions[v as usize];
        input.displacements[a] = at.displacement[v as usize];
    }
    input
}

/// Adds an element's nodal vector.
fn scatter(nodes: &[u32], local: &[[f64; 3]; MAX_NODES], global: &mut [[f64; 3]]) {
    for (a, &v) in nodes.iter().enumerate() {
        for i in 0..3 {
            global[v as usize][i] += local[a][i];
        }
    }
}
