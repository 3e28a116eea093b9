//! What one element contributes: residual, tangent, directional derivatives.
//!
//! Three-field formulation (Simo, Taylor and Pister 1985): displacement u, and discontinuous, element-wise linear
//! volume ratio θ and pressure p, four numbers each, condensed. Stationarity of ∫ Ψ_iso(F) + U(θ) + p (J − θ) dV with
//! U = κ/2 (ln θ)². With φ the basis of p and θ, orthonormal over the element (in physical coordinates, so that curved
//! elements keep their order), θ = Π J is explicit and so is the condensed pressure p = Π U′(Π J). Then
//!
//! * R_u = ∫ (P_iso + p cof F) : ∇N,  gap = Π U′(Π J) − p,
//! * B = ∫ φ cof F : ∇N,  D = ∫ φ φ U″(θ),
//! * condensed residual r = R_u + Bᵀ gap, tangent K = ∫ ∇N : ∂P/∂F|_p : ∇N + Bᵀ D B (symmetric),
//! * δp = D B δu + gap.
//!
//! Keeping p an independent iterate ("mixed Newton") is what makes large steps converge when κ ≫ μ: the geometric
//! stiffness never sees the spurious pressure of a trial state. Where p is not given it is the condensed one.
//! The constraint is on J, not on ln J: p ln J has the curvature −p/J² in volume changes that θ does not resolve, which
//! destabilises elements under tension next to the singular bonded edges (seen as indefinite tangents on fine meshes).
//!
//! Quadrature points are worked on eight at a time. How K and B are summed over them, [`super::stiffness_kernel`] says.

use super::element_data::{ElementInput, ElementOutput, ElementTables, MAX_GROUPS, MAX_NODES};
use super::fibre_kernel::{add_fibre_stress, add_fibre_tangent};
use super::law_kernel::{add_law_stress, add_law_tangent};
use super::stiffness_kernel::{add_pulled_back, stiffness};
use crate::material::{Lanes, SpectralState, Tensor};

/// A vector at the nodes of an element.
pub type NodalVector = [[f64; 3]; MAX_NODES];

/// Determinant and cofactor (determinant × inverse transpose) of a tensor.
#[inline(always)]
fn cofactor(f: &Tensor) -> (Lanes, Tensor) {
    let mut g = [[Lanes::ZERO; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            let (i1, i2, j1, j2) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
            g[i][j] = f[i1][j1] * f[i2][j2] - f[i1][j2] * f[i2][j1];
        }
    }
    (f[0][0] * g[0][0] + f[0][1] * g[0][1] + f[0][2] * g[0][2], g)
}

/// Σ_a x_a ⊗ ∂N_a/∂ξ at the points of a group.
#[inline(always)]
pub(super) fn gradient_of<const FMA: bool>(
    tables: &ElementTables,
    nodal: &[[f64; 3]; MAX_NODES],
    group: usize,
) -> Tensor {
    let mut out = [[Lanes::ZERO; 3]; 3];
    for a in 0..tables.num {
        for i in 0..3 {
            let x = Lanes::splat(nodal[a][i]);
            for c in 0..3 {
                out[i][c] = x.mul_add::<FMA>(tables.gradient_by_point[a][c][group], out[i][c]);
            }
        }
    }
    out
}

#[inline(always)]
pub(super) fn multiply(a: &Tensor, b: &Tensor) -> Tensor {
    let mut out = [[Lanes::ZERO; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            out[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
        }
    }
    out
}

#[inline(always)]
pub(super) fn contract(a: &Tensor, b: &Tensor) -> Lanes {
    let mut s = Lanes::ZERO;
    for i in 0..3 {
        for j in 0..3 {
            s += a[i][j] * b[i][j];
        }
    }
    s
}

#[inline(always)]
pub(super) fn scaled(a: &Tensor, factor: Lanes) -> Tensor {
    let mut out = *a;
    for x in out.iter_mut().flatten() {
        *x = *x * factor;
    }
    out
}

/// Geometry, F and the pressure basis. Returns false where an element is inverted.
#[inline(always)]
fn kinematics<const FMA: bool>(tables: &ElementTables, input: &ElementInput, out: &mut ElementOutput) -> bool {
    let mut centre = [0.0; 3];
    for a in 0..tables.num {
        for i in 0..3 {
            centre[i] += input.positions[a][i] / tables.num as f64;
        }
    }
    out.min_jacobian = f64::INFINITY;
    out.min_geometry_jacobian = f64::INFINITY;
    let mut volume = 0.0;
    for g in 0..tables.groups {
        let map = gradient_of::<FMA>(tables, &input.positions, g);
        let (det, cofactor) = cofactor(&map);
        out.min_geometry_jacobian = out.min_geometry_jacobian.min(det.min());
        out.volume[g] = det * tables.weight[g];
        volume += out.volume[g].sum();
        // Stored so that ∂N/∂X_J = Σ_c inverse_map[c][J] ∂N/∂ξ_c.
        for c in 0..3 {
            for j in 0..3 {
                out.inverse_map[g][c][j] = cofactor[j][c] / det;
            }
        }
        let h = gradient_of::<FMA>(tables, &input.displacements, g);
        let mut f = multiply(&h, &out.inverse_map[g]);
        for (i, row) in f.iter_mut().enumerate() {
            row[i] = row[i] + 1.0;
        }
        out.deformation_gradient[g] = f;
        for i in 0..3 {
            let mut x = Lanes::ZERO;
            for a in 0..tables.num {
                x = Lanes::splat(input.positions[a][i] - centre[i]).mul_add::<FMA>(tables.shape[a][g], x);
            }
            out.points[i][g] = x;
        }
    }
    if !(out.min_geometry_jacobian > 0.0) {
        return false;
    }
    // Gram–Schmidt on 1, x, y, z (scaled by the element's size) in the element's volume.
    let size = volume.cbrt();
    for m in 0..4 {
        for g in 0..tables.groups {
            out.basis[m][g] = if m == 0 { Lanes::splat(1.0) } else { out.points[m - 1][g] * (1.0 / size) };
        }
        out.basis_slope[m] = [0, 1, 2].map(|i| if m == i + 1 { 1.0 / size } else { 0.0 });
        // Twice is enough (Kahan): the second pass removes what rounding left.
        for _ in 0..2 {
            for l in 0..m {
                let mut dot = 0.0;
                for g in 0..tables.groups {
                    dot += (out.basis[l][g] * out.basis[m][g] * out.volume[g]).sum();
                }
                for g in 0..tables.groups {
                    let b = out.basis[l][g];
                    out.basis[m][g] -= b * dot;
                }
                for i in 0..3 {
                    out.basis_slope[m][i] -= out.basis_slope[l][i] * dot;
                }
            }
        }
        let mut norm = 0.0;
        for g in 0..tables.groups {
            norm += (out.basis[m][g] * out.basis[m][g] * out.volume[g]).sum();
        }
        let scale = 1.0 / norm.sqrt();
        for g in 0..tables.groups {
            out.basis[m][g] = out.basis[m][g] * scale;
        }
        out.basis_slope[m] = out.basis_slope[m].map(|s| s * scale);
    }
    for g in 0..tables.groups {
        for i in 0..3 {
            out.points[i][g] = out.points[i][g] + centre[i];
        }
    }
    true
}

/// Adds ∫ stress : ∇N to the residual; `stress` is weighted by the volume already.
#[inline(always)]
pub(super) fn add_internal_force<const FMA: bool>(
    tables: &ElementTables,
    inverse_map: &[Tensor; MAX_GROUPS],
    stress: &[Tensor; MAX_GROUPS],
    residual: &mut [[f64; 3]; MAX_NODES],
) {
    let mut pulled = [[[Lanes::ZERO; 3]; 3]; MAX_GROUPS];
    for g in 0..tables.groups {
        for i in 0..3 {
            for c in 0..3 {
                let (s, m) = (&stress[g][i], &inverse_map[g][c]);
                pulled[g][i][c] = s[0] * m[0] + s[1] * m[1] + s[2] * m[2];
            }
        }
    }
    for a in 0..tables.num {
        for i in 0..3 {
            let mut s = Lanes::ZERO;
            for g in 0..tables.groups {
                for c in 0..3 {
                    s = pulled[g][i][c].mul_add::<FMA>(tables.gradient_by_point[a][c][g], s);
                }
            }
            residual[a][i] += s.sum();
        }
    }
}

/// Residual and, where `TANGENT`, stiffness. Returns false where det F ≤ 0 somewhere (then only the minima are set).
#[inline(always)]
pub(super) fn element<const FMA: bool, const TANGENT: bool>(
    tables: &ElementTables,
    input: &ElementInput,
    out: &mut ElementOutput,
) -> bool {
    if !kinematics::<FMA>(tables, input, out) {
        return false;
    }
    let kappa = input.material.bulk_kpa;
    let tensor = [[Lanes::ZERO; 3]; 3];
    let mut projected = [0.0; 4];
    for g in 0..tables.groups {
        let (j, cofactor) = cofactor(&out.deformation_gradient[g]);
        out.cofactor[g] = cofactor;
        out.jacobian[g] = j;
        let smallest = j.min();
        if !(smallest >= out.min_jacobian) {
            out.min_jacobian = smallest;
        }
        for m in 0..4 {
            projected[m] += (j * out.volume[g] * out.basis[m][g]).sum();
        }
    }
    if !(out.min_jacobian > 0.0) {
        return false;
    }
    let mut condensed = [0.0; 4];
    out.bulk = [[0.0; 4]; 4];
    for g in 0..tables.groups {
        let mut ratio = Lanes::ZERO;
        for m in 0..4 {
            ratio += out.basis[m][g] * projected[m];
        }
        let smallest = ratio.min();
        if !(smallest > 0.0) {
            out.min_jacobian = smallest;
            return false;
        }
        let log = match input.log_growth {
            Some(growth) => ratio.ln() - growth[g],
            None => ratio.ln(),
        };
        let first = log * kappa / ratio * out.volume[g];
        let second = (Lanes::splat(1.0) - log) * kappa / (ratio * ratio) * out.volume[g];
        for m in 0..4 {
            condensed[m] += (first * out.basis[m][g]).sum();
            for n in 0..=m {
                out.bulk[m][n] += (second * out.basis[m][g] * out.basis[n][g]).sum();
            }
        }
    }
    for m in 0..4 {
        for n in 0..m {
            out.bulk[n][m] = out.bulk[m][n];
        }
        out.pressure[m] = input.pressure.map_or(condensed[m], |p| p[m]);
        out.pressure_gap[m] = condensed[m] - out.pressure[m];
    }
    let mut weighted = [tensor; MAX_GROUPS];
    for g in 0..tables.groups {
        let (mut p, mut gap) = (Lanes::ZERO, Lanes::ZERO);
        for m in 0..4 {
            p += out.basis[m][g] * out.pressure[m];
            gap += out.basis[m][g] * out.pressure_gap[m];
        }
        let state = SpectralState::new(input.material, &out.deformation_gradient[g]);
        // P is linear in the energy: f Ψ_iso with pressure p is f (Ψ_iso with pressure p/f).
        let factor = input.stiffness_factor.map_or(Lanes::splat(1.0), |f| f[g]);
        let kirchhoff = p * out.jacobian[g] / factor;
        let mut stress = state.first_piola_kirchhoff_stress(kirchhoff);
        if let Some(law) = &input.law {
            let f = &out.deformation_gradient[g];
            add_law_stress(law, f, out.jacobian[g], &out.cofactor[g], &mut stress);
        }
        out.stress[g] = scaled(&stress, factor);
        if let Some(fibre) = &input.fibre {
            add_fibre_stress(fibre, &out.deformation_gradient[g], &mut out.stress[g]);
        }
        for i in 0..3 {
            for j in 0..3 {
                weighted[g][i][j] = (out.stress[g][i][j] + gap * out.cofactor[g][i][j]) * out.volume[g];
            }
        }
        if TANGENT {
            let (f, map, moduli) = (&out.deformation_gradient[g], &out.inverse_map[g], &mut out.tangent[g]);
            let weight = factor * out.volume[g];
            state.pulled_back(map).material_tangent::<FMA>(input.material, kirchhoff, kirchhoff, moduli);
            for x in moduli.iter_mut().flatten() {
                *x = *x * weight;
            }
            if let Some(law) = &input.law {
                let mut own = [[Lanes::ZERO; 9]; 9];
                add_law_tangent(law, f, out.jacobian[g], &out.cofactor[g], &mut own);
                add_pulled_back::<FMA>(&own, map, weight, moduli);
            }
            if let Some(fibre) = &input.fibre {
                let mut own = [[Lanes::ZERO; 9]; 9];
                add_fibre_tangent(fibre, f, &mut own);
                add_pulled_back::<FMA>(&own, map, out.volume[g], moduli);
            }
        }
    }
    out.residual = [[0.0; 3]; MAX_NODES];
    add_internal_force::<FMA>(tables, &out.inverse_map, &weighted, &mut out.residual);
    if TANGENT {
        stiffness::<FMA>(tables, out);
    }
    true
}
