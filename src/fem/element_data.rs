//! What goes into the element kernels and what comes out: tables of an element kind, the state of one element, its
//! results.
//!
//! Quadrature points stand in lanes, eight to a group; nodes of the stiffness likewise.

use super::departures::Fibre;
use super::law_correction::LawCorrection;
use crate::material::{LANES, Lanes, Material, Parameter, Tensor};
use crate::mesh::ElementKind;

/// Most nodes (and quadrature points) of an element.
pub const MAX_NODES: usize = 27;
/// Groups of eight lanes that cover them.
pub const MAX_GROUPS: usize = 4;

/// Most places of nodes (and of quadrature points) in the section of an element.
pub const MAX_SECTION: usize = 9;
/// Levels l of the row and l′ of the column of what the lower triangle of a stiffness is made of.
pub const PAIRED_LEVELS: [[usize; 2]; 6] = [[1, 0], [2, 0], [2, 1], [0, 0], [1, 1], [2, 2]];
/// Groups of lanes that hold a 3×3 block of each of them.
pub const BLOCK_GROUPS: usize = 7;
/// For a place s of the rows and a place s′ of the columns: the 3×3 block of each of [`PAIRED_LEVELS`]. The first eight
/// entries, column by column, stand in a group of lanes of their own, the ninth ones together in the last group.
pub type Blocks = [Lanes; BLOCK_GROUPS];

/// Constant tables of an element kind.
pub struct ElementTables {
    /// Nodes, and equally quadrature points (27 or 21).
    pub(super) num: usize,
    pub(super) groups: usize,
    /// `[node][group]`: N_a at the quadrature points.
    pub(super) shape: Vec<[Lanes; MAX_GROUPS]>,
    /// `[node][c][group]`: ∂N_a/∂ξ_c at the quadrature points.
    pub(super) gradient_by_point: Vec<[[Lanes; MAX_GROUPS]; 3]>,
    /// `[point][c][group of nodes]`: the same, nodes in lanes (zero past the last node).
    pub(super) gradient_by_node: Vec<[[Lanes; MAX_GROUPS]; 3]>,
    /// Quadrature weights; zero in padding lanes.
    pub(super) weight: [Lanes; MAX_GROUPS],
    /// Nodes, and equally quadrature points, of a section.
    pub(super) section: usize,
    /// `[t][c][s]`: the factor of ∂N_a/∂ξ_c that depends on the places of node and point in the section.
    pub(super) section_functions: [[[f64; MAX_SECTION]; 3]; MAX_SECTION],
    /// `[3 c + d][m]`: λ_lc(m) λ_l′d(m) of all [`PAIRED_LEVELS`], where λ_lc is the factor that depends on the levels.
    pub(super) line_products: [[Lanes; 3]; 9],
}

impl ElementTables {
    /// Tables of `kind`.
    pub fn new(kind: ElementKind) -> ElementTables {
        let points = kind.quadrature();
        let num = kind.num_nodes();
        let groups = num.div_ceil(LANES);
        let zero = [Lanes::ZERO; MAX_GROUPS];
        let mut tables = ElementTables {
            num,
            groups,
            shape: vec![zero; num],
            gradient_by_point: vec![[zero; 3]; num],
            gradient_by_node: vec![[zero; 3]; num],
            weight: zero,
            section: num / 3,
            section_functions: [[[0.0; MAX_SECTION]; 3]; MAX_SECTION],
            line_products: [[Lanes::ZERO; 3]; 9],
        };
        tables.factorise(kind);
        for slot in 0..groups * LANES {
            // Padding lanes repeat the first point with weight zero, so that nothing divides by zero there.
            let q = if slot < num { slot } else { 0 };
            let (x, w) = points[q];
            let (n, g) = (kind.shape_functions(x), kind.shape_gradients(x));
            let (group, lane) = (slot / LANES, slot % LANES);
            tables.weight[group].0[lane] = if slot < num { w } else { 0.0 };
            for a in 0..num {
                tables.shape[a][group].0[lane] = n[a];
                for c in 0..3 {
                    tables.gradient_by_point[a][c][group].0[lane] = g[a][c];
                    if slot < num {
                        tables.gradient_by_node[q][c][a / LANES].0[a % LANES] = g[a][c];
                    }
                }
            }
        }
        tables
    }

    /// Takes the shape functions apart into those of the section and those of the line. Either sum to 1.
    fn factorise(&mut self, kind: ElementKind) {
        let (points, section) = (kind.quadrature(), self.section);
        for t in 0..section {
            let (n, g) = (kind.shape_functions(points[t].0), kind.shape_gradients(points[t].0));
            for a in 0..self.num {
                for c in 0..2 {
                    self.section_functions[t][c][a % section] += g[a][c];
                }
                self.section_functions[t][2][a % section] += n[a];
            }
        }
        for m in 0..3 {
            let at = points[section * m].0;
            let (n, g) = (kind.shape_functions(at), kind.shape_gradients(at));
            let mut line = [[0.0; 3]; 3];
            for a in 0..self.num {
                for c in 0..3 {
                    line[c][a / section] += if c == 2 { g[a][2] } else { n[a] };
                }
            }
            for cd in 0..9 {
                for (pair, [row, column]) in PAIRED_LEVELS.into_iter().enumerate() {
                    self.line_products[cd][m].0[pair] = line[cd / 3][row] * line[cd % 3][column];
                }
            }
        }
    }

    /// Number of nodes and of quadrature points.
    pub fn num_nodes(&self) -> usize {
        self.num
    }
}

/// The state of one element.
pub struct ElementInput<'a> {
    /// Reference positions of the nodes, mm.
    pub positions: [[f64; 3]; MAX_NODES],
    /// Displacements of the nodes, mm.
    pub displacements: [[f64; 3]; MAX_NODES],
    /// Pressure coefficients; `None` for the condensed ones.
    pub pressure: Option<[f64; 4]>,
    /// The material.
    pub material: &'a Material,
    /// Factor on the isochoric stiffness at the quadrature points; one if absent.
    pub stiffness_factor: Option<&'a [Lanes; MAX_GROUPS]>,
    /// ln of the volume ratio free of pressure at the quadrature points; zero if absent.
    pub log_growth: Option<&'a [Lanes; MAX_GROUPS]>,
    /// Fibres.
    pub fibre: Option<Fibre>,
    /// A correction of the material's law.
    pub law: Option<LawCorrection>,
}

/// A direction in which the condensed residual of an element is differentiated: rates per unit of t. What is absent
/// stays.
#[derive(Clone, Default)]
pub struct Variation<'a> {
    /// Of the reference positions of the nodes, mm.
    pub velocities: Option<[[f64; 3]; MAX_NODES]>,
    /// Of the displacements following the nodes, mm.
    pub displacements: Option<[[f64; 3]; MAX_NODES]>,
    /// The parameter of the material that moves by 1.
    pub parameter: Option<Parameter>,
    /// Of the factor on the isochoric stiffness at the quadrature points.
    pub stiffness_factor: Option<&'a [Lanes; MAX_GROUPS]>,
    /// Of ln of the volume ratio free of pressure at the quadrature points.
    pub log_growth: Option<&'a [Lanes; MAX_GROUPS]>,
    /// The fibres at the ends of a central difference.
    pub fibre: Option<FibreDifference>,
    /// Of the correction of the law, in which its stress is linear.
    pub law: Option<LawCorrection>,
}

/// Fibres ahead and behind, and half of what lies between them in t. The stress of fibres is differenced between them.
#[derive(Clone, Copy, Debug)]
pub struct FibreDifference {
    /// Fibres at t = `step`, at t = −`step`.
    pub ends: [Option<Fibre>; 2],
    /// Half the difference of t.
    pub step: f64,
}

/// What one element yields. Reused between elements.
pub struct ElementOutput {
    /// Condensed residual r per node, kPa·mm².
    pub residual: [[f64; 3]; MAX_NODES],
    /// What the pressure iterate misses.
    pub pressure_gap: [f64; 4],
    /// D.
    pub bulk: [[f64; 4]; 4],
    /// Pressure coefficients used: condensed ones where none were given.
    pub pressure: [f64; 4],
    /// B: `[m][i][group of nodes]`.
    pub divergence: [[[Lanes; MAX_GROUPS]; 3]; 4],
    /// K: `[9 s′ + s]`, of l = l′ for s ≥ s′ alone.
    pub stiffness: Vec<Blocks>,
    /// Smallest det F over the quadrature points (the element is unusable where it is not positive).
    pub min_jacobian: f64,
    /// Smallest determinant of the geometry map.
    pub min_geometry_jacobian: f64,
    /// Deformation gradients at the quadrature points, `[group]`.
    pub deformation_gradient: [Tensor; MAX_GROUPS],
    /// First Piola–Kirchhoff stress at the quadrature points.
    pub stress: [Tensor; MAX_GROUPS],
    /// Quadrature weight × geometry determinant, mm³.
    pub volume: [Lanes; MAX_GROUPS],
    /// Reference positions of the quadrature points, `[i][group]`.
    pub points: [[Lanes; MAX_GROUPS]; 3],
    /// ∂ξ_c/∂X_J, `[c][J]`.
    pub(super) inverse_map: [Tensor; MAX_GROUPS],
    pub(super) cofactor: [Tensor; MAX_GROUPS],
    pub(super) jacobian: [Lanes; MAX_GROUPS],
    /// φ at the quadrature points, `[m][group]`.
    pub basis: [[Lanes; MAX_GROUPS]; 4],
    /// ∇φ, which is constant over the element, 1/mm.
    pub(super) basis_slope: [[f64; 3]; 4],
    /// A, `[3 i + J][3 k + L]`; for a stiffness weighted, and pulled back to the reference element.
    pub(super) tangent: Vec<[[Lanes; 9]; 9]>,
    pub(super) work: Box<StiffnessWork>,
}

/// What a stiffness is made of, on the way; see [`super::stiffness_kernel`].
pub(super) struct StiffnessWork {
    /// Moduli pulled back to the reference element, `[point][3 c + d]`: the first eight components 3 k + i.
    pub(super) moduli: [[Lanes; 9]; MAX_NODES],
    /// The ninth component.
    pub(super) last_modulus: [[f64; 9]; MAX_NODES],
    /// A^ll′, `[t][3 c + d]`.
    pub(super) along_line: [[Blocks; 9]; MAX_SECTION],
    /// T of a group of lanes, `[s′][t][c]`.
    pub(super) traction: [[[Lanes; 3]; MAX_SECTION]; MAX_SECTION],
    /// B of the rows, `[s][m]`.
    pub(super) divergence: [[Blocks; 4]; MAX_SECTION],
    /// D B of the columns, `[s′][m]`.
    pub(super) stiffened: [[Blocks; 4]; MAX_SECTION],
}

impl Default for ElementOutput {
    fn default() -> Self {
        let tensor = [[Lanes::ZERO; 3]; 3];
        ElementOutput {
            residual: [[0.0; 3]; MAX_NODES],
            pressure_gap: [0.0; 4],
            bulk: [[0.0; 4]; 4],
            pressure: [0.0; 4],
            divergence: [[[Lanes::ZERO; MAX_GROUPS]; 3]; 4],
            stiffness: vec![[Lanes::ZERO; BLOCK_GROUPS]; MAX_SECTION * MAX_SECTION],
            min_jacobian: 0.0,
            min_geometry_jacobian: 0.0,
            deformation_gradient: [tensor; MAX_GROUPS],
            stress: [tensor; MAX_GROUPS],
            volume: [Lanes::ZERO; MAX_GROUPS],
            points: [[Lanes::ZERO; MAX_GROUPS]; 3],
            inverse_map: [tensor; MAX_GROUPS],
            cofactor: [tensor; MAX_GROUPS],
            jacobian: [Lanes::ZERO; MAX_GROUPS],
            basis: [[Lanes::ZERO; MAX_GROUPS]; 4],
            basis_slope: [[0.0; 3]; 4],
            tangent: vec![[[Lanes::ZERO; 9]; 9]; MAX_GROUPS],
            work: Box::new(StiffnessWork {
                moduli: [[Lanes::ZERO; 9]; MAX_NODES],
                last_modulus: [[0.0; 9]; MAX_NODES],
                along_line: [[[Lanes::ZERO; BLOCK_GROUPS]; 9]; MAX_SECTION],
                traction: [[[Lanes::ZERO; 3]; MAX_SECTION]; MAX_SECTION],
                divergence: [[[Lanes::ZERO; BLOCK_GROUPS]; 4]; MAX_SECTION],
                stiffened: [[[Lanes::ZERO; BLOCK_GROUPS]; 4]; MAX_SECTION],
            }),
        }
    }
}
