//! B and K of one element from the tangents A at its quadrature points (see [`super::kernel`]).
//!
//! Both elements are a section times a line: node a = (s, l) and point q = (t, m) are places s, t of the section on
//! levels l, m, and derivatives of the shape functions are products, ∂N_a/∂ξ_c (q) = h_sc(t) λ_lc(m). The sum over the
//! points is therefore done one factor after the other. With A pulled back to the reference element and weighted by
//! the volume, A_ic,kd = Σ_JL ∂ξ_c/∂X_J A_iJkL ∂ξ_d/∂X_L,
//!
//! * A^ll′_ic,kd(t) = Σ_m λ_lc(m) λ_l′d(m) A_ic,kd(t, m),
//! * T_s′,ic,k(t) = Σ_d h_s′d(t) A^ll′_ic,kd(t),
//! * K_(s,l)i,(s′,l′)k = Σ_tc h_sc(t) T_s′,ic,k(t) + (Bᵀ D B)_(s,l)i,(s′,l′)k.
//!
//! This takes less than half the products of ∇N : A : ∇N at every point. Whatever depends on the state has the indices
//! l, l′, i and k throughout: these stand in lanes ([`Blocks`]), and all else is a table.

use super::element_data::{
    BLOCK_GROUPS, Blocks, ElementOutput, ElementTables, MAX_GROUPS, MAX_SECTION, PAIRED_LEVELS, StiffnessWork,
};
use crate::material::{LANES, Lanes, Tensor};

/// B and K from the moduli.
#[inline(always)]
pub(super) fn stiffness<const FMA: bool>(tables: &ElementTables, out: &mut ElementOutput) {
    divergence::<FMA>(tables, out);
    for g in 0..tables.groups {
        by_point(tables, g, &out.tangent[g], &mut out.work);
    }
    sum_along_line::<FMA>(tables, &mut out.work);
    spread_pressures(tables, out);
    for group in 0..BLOCK_GROUPS {
        section_tractions::<FMA>(tables, group, &mut out.work);
        for column in 0..tables.section {
            // What is above the diagonal of nodes is not asked for.
            let mut first = if is_of_one_level(group) { column } else { 0 };
            while first < tables.section {
                // In parts of at most five rows, as equal as can be, whose sums stay in registers.
                let left = tables.section - first;
                let rows = left.div_ceil(left.div_ceil(5));
                match rows {
                    5 => rows_of::<FMA, 5>(tables, group, column, first, &out.work, &mut out.stiffness),
                    4 => rows_of::<FMA, 4>(tables, group, column, first, &out.work, &mut out.stiffness),
                    3 => rows_of::<FMA, 3>(tables, group, column, first, &out.work, &mut out.stiffness),
                    2 => rows_of::<FMA, 2>(tables, group, column, first, &out.work, &mut out.stiffness),
                    _ => rows_of::<FMA, 1>(tables, group, column, first, &out.work, &mut out.stiffness),
                }
                first += rows;
            }
        }
    }
}

/// Whether all lanes of a group are of l = l′.
#[inline(always)]
fn is_of_one_level(group: usize) -> bool {
    PAIRED_LEVELS.get(group).is_some_and(|[row, column]| row == column)
}

/// B.
#[inline(always)]
fn divergence<const FMA: bool>(tables: &ElementTables, out: &mut ElementOutput) {
    let mut divergence = [[[Lanes::ZERO; MAX_GROUPS]; 3]; 4];
    for g in 0..tables.groups {
        // cof F pulled back, and φ times the volume.
        let mut pulled = [[Lanes::ZERO; 3]; 3];
        for i in 0..3 {
            for c in 0..3 {
                let (s, m) = (&out.cofactor[g][i], &out.inverse_map[g][c]);
                pulled[i][c] = s[0] * m[0] + s[1] * m[1] + s[2] * m[2];
            }
        }
        let mut weight = [Lanes::ZERO; 4];
        for m in 0..4 {
            weight[m] = out.basis[m][g] * out.volume[g];
        }
        for l in 0..LANES.min(tables.num - g * LANES) {
            let gradient = &tables.gradient_by_node[g * LANES + l];
            for i in 0..3 {
                for n in 0..tables.groups {
                    let mut d = Lanes::ZERO;
                    for c in 0..3 {
                        d = Lanes::splat(pulled[i][c].0[l]).mul_add::<FMA>(gradient[c][n], d);
                    }
                    for m in 0..4 {
                        divergence[m][i][n] = Lanes::splat(weight[m].0[l]).mul_add::<FMA>(d, divergence[m][i][n]);
                    }
                }
            }
        }
    }
    out.divergence = divergence;
}

/// Adds a tangent of nominal stresses, pulled back and times `weight`, at the points of a group.
#[inline(always)]
pub(super) fn add_pulled_back<const FMA: bool>(
    nominal: &[[Lanes; 9]; 9],
    map: &Tensor,
    weight: Lanes,
    moduli: &mut [[Lanes; 9]; 9],
) {
    for i in 0..3 {
        for k in 0..3 {
            let mut half = [[Lanes::ZERO; 3]; 3];
            for j in 0..3 {
                for d in 0..3 {
                    for l in 0..3 {
                        half[j][d] = nominal[3 * i + j][3 * k + l].mul_add::<FMA>(map[d][l] * weight, half[j][d]);
                    }
                }
            }
            for c in 0..3 {
                for d in 0..3 {
                    let sum = &mut moduli[3 * i + c][3 * k + d];
                    for j in 0..3 {
                        *sum = half[j][d].mul_add::<FMA>(map[c][j], *sum);
                    }
                }
            }
        }
    }
}

/// The moduli of a group of points, point by point.
#[inline(always)]
fn by_point(tables: &ElementTables, group: usize, moduli: &[[Lanes; 9]; 9], work: &mut StiffnessWork) {
    for lane in 0..LANES.min(tables.num - group * LANES) {
        let point = group * LANES + lane;
        for c in 0..3 {
            for d in 0..3 {
                // The component 3 k + i.
                let mut own = Lanes::ZERO;
                for ki in 0..LANES {
                    own.0[ki] = moduli[3 * (ki % 3) + c][3 * (ki / 3) + d].0[lane];
                }
                work.moduli[point][3 * c + d] = own;
                work.last_modulus[point][3 * c + d] = moduli[6 + c][6 + d].0[lane];
            }
        }
    }
}

/// A^ll′.
#[inline(always)]
fn sum_along_line<const FMA: bool>(tables: &ElementTables, work: &mut StiffnessWork) {
    let section = tables.section;
    for t in 0..section {
        for cd in 0..9 {
            let factors = &tables.line_products[cd];
            let mut sum = [Lanes::ZERO; BLOCK_GROUPS];
            for m in 0..3 {
                let x = work.moduli[t + section * m][cd];
                for pair in 0..PAIRED_LEVELS.len() {
                    sum[pair] = x.mul_add::<FMA>(Lanes::splat(factors[m].0[pair]), sum[pair]);
                }
                let last = Lanes::splat(work.last_modulus[t + section * m][cd]);
                sum[BLOCK_GROUPS - 1] = last.mul_add::<FMA>(factors[m], sum[BLOCK_GROUPS - 1]);
            }
            work.along_line[t][cd] = sum;
        }
    }
}

/// B and D B in lanes.
#[inline(always)]
fn spread_pressures(tables: &ElementTables, out: &mut ElementOutput) {
    let section = tables.section;
    let mut stiffened = [[[Lanes::ZERO; MAX_GROUPS]; 3]; 4];
    for m in 0..4 {
        for n in 0..4 {
            for i in 0..3 {
                for g in 0..tables.groups {
                    stiffened[m][i][g] += out.divergence[n][i][g] * out.bulk[m][n];
                }
            }
        }
    }
    for s in 0..section {
        for m in 0..4 {
            let (row, column) = (&mut out.work.divergence[s][m], &mut out.work.stiffened[s][m]);
            for level in 0..3 {
                let (group, lane) = ((s + section * level) / LANES, (s + section * level) % LANES);
                let (mut b, mut d) = ([0.0; 3], [0.0; 3]);
                for i in 0..3 {
                    b[i] = out.divergence[m][i][group].0[lane];
                    d[i] = stiffened[m][i][group].0[lane];
                }
                let b_lanes = Lanes([b[0], b[1], b[2], b[0], b[1], b[2], b[0], b[1]]);
                let d_lanes = Lanes([d[0], d[0], d[0], d[1], d[1], d[1], d[2], d[2]]);
                for (pair, levels) in PAIRED_LEVELS.iter().enumerate() {
                    if levels[0] == level {
                        row[pair] = b_lanes;
                        row[BLOCK_GROUPS - 1].0[pair] = b[2];
                    }
                    if levels[1] == level {
                        column[pair] = d_lanes;
                        column[BLOCK_GROUPS - 1].0[pair] = d[2];
                    }
                }
            }
        }
    }
}

/// T of a group.
#[inline(always)]
fn section_tractions<const FMA: bool>(tables: &ElementTables, group: usize, work: &mut StiffnessWork) {
    for t in 0..tables.section {
        let [h0, h1, h2] = &tables.section_functions[t];
        for c in 0..3 {
            let a = &work.along_line[t];
            let (a0, a1, a2) = (a[3 * c][group], a[3 * c + 1][group], a[3 * c + 2][group]);
            for s in 0..tables.section {
                let mut sum = a0 * h0[s];
                sum = a1.mul_add::<FMA>(Lanes::splat(h1[s]), sum);
                work.traction[s][t][c] = a2.mul_add::<FMA>(Lanes::splat(h2[s]), sum);
            }
        }
    }
}

/// `N` rows of a column of the stiffness, from `first` on.
#[inline(always)]
fn rows_of<const FMA: bool, const N: usize>(
    tables: &ElementTables,
    group: usize,
    column: usize,
    first: usize,
    work: &StiffnessWork,
    stiffness: &mut [Blocks],
) {
    let mut sum = [Lanes::ZERO; N];
    for m in 0..4 {
        let x = work.stiffened[column][m][group];
        for n in 0..N {
            sum[n] = work.divergence[first + n][m][group].mul_add::<FMA>(x, sum[n]);
        }
    }
    for t in 0..tables.section {
        for c in 0..3 {
            let traction = work.traction[column][t][c];
            let h = &tables.section_functions[t][c][first..first + N];
            for n in 0..N {
                sum[n] = traction.mul_add::<FMA>(Lanes::splat(h[n]), sum[n]);
            }
        }
    }
    for n in 0..N {
        stiffness[MAX_SECTION * column + first + n][group] = sum[n];
    }
}

#[cfg(test)]
mod tests {
    use super::super::departures::Fibre;
    use super::super::element_data::{ElementInput, MAX_NODES};
    use super::super::kernels::Kernels;
    use super::super::law_correction::LawCorrection;
    use super::*;
    use crate::material::Material;
    use crate::mesh::ElementKind;

    const STEP_MM: f64 = 3e-4;

    /// The entry of component i of node a and component k of node b.
    fn entry(out: &ElementOutput, section: usize, [a, i]: [usize; 2], [b, k]: [usize; 2]) -> f64 {
        let levels = [a / section, b / section];
        let pair = PAIRED_LEVELS.iter().position(|&l| l == levels).expect("of the lower triangle");
        let own = &out.stiffness[MAX_SECTION * (b % section) + a % section];
        if 3 * k + i < LANES { own[pair].0[3 * k + i] } else { own[BLOCK_GROUPS - 1].0[pair] }
    }

    /// K is the derivative of the condensed residual where the pressure is the condensed one, here of elements out of
    /// shape with all departures that have a tangent. Central differences of fourth order err by 4·10⁻¹⁰ of K in the
    /// prism over this step, and by a hundred times as much over one of 10⁻³ mm.
    #[test]
    fn stiffness_is_the_derivative_of_the_residual() {
        let material = Material::new(400.0, [(17.0, 1.91), (-2.0, -2.3)]).expect("valid");
        let mut factor = [Lanes::splat(1.0); MAX_GROUPS];
        for (g, lanes) in factor.iter_mut().enumerate() {
            for l in 0..LANES {
                lanes.0[l] += 0.1 * ((LANES * g + l) as f64).sin();
            }
        }
        for kind in [ElementKind::Hex27, ElementKind::Prism21] {
            let (tables, num, section) = (ElementTables::new(kind), kind.num_nodes(), kind.num_nodes() / 3);
            let mut input = ElementInput {
                positions: [[0.0; 3]; MAX_NODES],
                displacements: [[0.0; 3]; MAX_NODES],
                pressure: None,
                material: &material,
                stiffness_factor: Some(&factor),
                log_growth: None,
                fibre: Some(Fibre { direction: [0.6, 0.0, 0.8], modulus_kpa: 3.0 }),
                law: Some(LawCorrection { reach: 1.3, coefficients_kpa: [4.0, -3.0, 2.5, 1.5] }),
            };
            for (a, x) in kind.node_coordinates().into_iter().enumerate() {
                let off = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0].map(|k| 0.03 * (k + 3.7 * a as f64).sin());
                input.positions[a] = [0.5 * x[0] + off[0], 0.6 * x[1] + off[1], 0.7 * x[2] + off[2]];
                let [x, y, z] = input.positions[a];
                input.displacements[a] = [0.5 * y + off[3], 0.1 * x - 0.05 * z + off[4], 0.1 * y + off[5]];
            }
            for kernels in [Kernels::detect(), Kernels::portable()] {
                let (mut out, mut moved) = (ElementOutput::default(), ElementOutput::default());
                assert!(kernels.tangent(&tables, &input, &mut out));
                let (mut largest, mut worst) = (0f64, 0f64);
                for (b, k) in (0..num).flat_map(|b| [0, 1, 2].map(|k| (b, k))) {
                    let mut slope = [[0.0; 3]; MAX_NODES];
                    let at_rest = input.displacements[b][k];
                    for (by, weight) in [(1.0, 8.0), (-1.0, -8.0), (2.0, -1.0), (-2.0, 1.0)] {
                        input.displacements[b][k] = at_rest + STEP_MM * by;
                        assert!(kernels.residual(&tables, &input, &mut moved));
                        for (slope, residual) in slope.iter_mut().flatten().zip(moved.residual.iter().flatten()) {
                            *slope += weight * residual / (12.0 * STEP_MM);
                        }
                    }
                    input.displacements[b][k] = at_rest;
                    for a in b..num {
                        for i in 0..3 {
                            let found = entry(&out, section, [a, i], [b, k]);
                            largest = largest.max(found.abs());
                            worst = worst.max((found - slope[a][i]).abs());
                        }
                    }
                }
                assert!(worst < 3e-9 * largest, "{kind:?}, {}: {worst} of {largest}", kernels.name);
            }
        }
    }
}
