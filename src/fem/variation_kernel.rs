//! Derivatives of an element's condensed residual r along rates of anything that it depends on, in closed form.
//!
//! With V the velocity of the nodes, L = ∇V, H = F − 1, w the rate of the displacement following the nodes, and A the
//! tangent ∂P/∂F at fixed pressure:
//!
//! * δF = ∇w − H L, δ(dV) = tr L dV, δ(∇N) = −Lᵀ ∇N;
//! * r = ∫ P : ∇N gives δr = ∫ (δP − P Lᵀ + P tr L) : ∇N with δP = A : δF + δp cof F + what the other rates do to P;
//! * θ = Π J and p = Π U′(θ) are projections onto functions that are linear in the reference position. Such a function
//!   f̄ = Σ c φ = Π f is fixed by ∫ (f̄ − f) φ dV = 0. The basis moves with the nodes, δφ = ∇φ · V (∇φ is constant), so
//!   that δf̄ = ∇f̄ · V + Σ φ ∫ [(δf − ∇f̄ · V + (f − f̄) tr L) φ + (f − f̄) δφ] dV.
//!
//! All that depends on the state alone is worked out once for any number of rates.

use super::element_data::{ElementInput, ElementOutput, ElementTables, MAX_GROUPS, MAX_NODES, Variation};
use super::fibre_kernel::{add_fibre_stress, add_fibre_tangent};
use super::kernel::{NodalVector, add_internal_force, contract, element, gradient_of, multiply, scaled};
use super::law_kernel::{add_law_stress, add_law_tangent};
use crate::material::{Lanes, Parameter, SpectralState, Tensor};

const ZERO_TENSOR: Tensor = [[Lanes::ZERO; 3]; 3];

/// The state at the quadrature points of a group.
#[derive(Clone, Copy)]
struct PointState {
    /// θ.
    volume_ratio: Lanes,
    /// ln θ, less that of growth.
    log_ratio: Lanes,
    /// p.
    pressure: Lanes,
}

/// The state of an element.
struct State {
    points: [PointState; MAX_GROUPS],
    /// Coefficients of θ and of p.
    coefficients: [[f64; 4]; 2],
}

/// The rate of a geometry at the points of a group.
#[derive(Clone, Copy)]
struct GeometryRate {
    /// L.
    gradient: Tensor,
    /// tr L.
    dilation: Lanes,
    /// δφ.
    basis: [Lanes; 4],
}

/// Derivatives of the residual along `variations`. Returns false where the element is inverted.
#[inline(always)]
pub(super) fn variations<const FMA: bool>(
    tables: &ElementTables,
    input: &ElementInput,
    variations: &[Variation],
    out: &mut ElementOutput,
    found: &mut [NodalVector],
) -> bool {
    if !element::<FMA, false>(tables, input, out) {
        return false;
    }
    let state = state_of(tables, input, out);
    if variations.iter().any(|v| v.displacements.is_some() || v.velocities.is_some()) {
        tangents::<FMA>(tables, input, &state, out);
    }
    for (variation, found) in variations.iter().zip(found) {
        *found = varied::<FMA>(tables, input, &state, variation, out);
    }
    true
}

#[inline(always)]
fn state_of(tables: &ElementTables, input: &ElementInput, out: &ElementOutput) -> State {
    let mut ratio = [0.0; 4];
    for g in 0..tables.groups {
        for m in 0..4 {
            ratio[m] += (out.jacobian[g] * out.volume[g] * out.basis[m][g]).sum();
        }
    }
    let mut points =
        [PointState { volume_ratio: Lanes::ZERO, log_ratio: Lanes::ZERO, pressure: Lanes::ZERO }; MAX_GROUPS];
    for (g, point) in points.iter_mut().enumerate().take(tables.groups) {
        for m in 0..4 {
            point.volume_ratio += out.basis[m][g] * ratio[m];
            point.pressure += out.basis[m][g] * out.pressure[m];
        }
        point.log_ratio = match input.log_growth {
            Some(growth) => point.volume_ratio.ln() - growth[g],
            None => point.volume_ratio.ln(),
        };
    }
    State { points, coefficients: [ratio, out.pressure] }
}

/// A at the quadrature points.
#[inline(always)]
fn tangents<const FMA: bool>(tables: &ElementTables, input: &ElementInput, state: &State, out: &mut ElementOutput) {
    for g in 0..tables.groups {
        let f = &out.deformation_gradient[g];
        let factor = input.stiffness_factor.map_or(Lanes::splat(1.0), |f| f[g]);
        let kirchhoff = state.points[g].pressure * out.jacobian[g] / factor;
        SpectralState::new(input.material, f).material_tangent::<FMA>(
            input.material,
            kirchhoff,
            kirchhoff,
            &mut out.tangent[g],
        );
        if let Some(law) = &input.law {
            add_law_tangent(law, f, out.jacobian[g], &out.cofactor[g], &mut out.tangent[g]);
        }
        for row in &mut out.tangent[g] {
            for x in row.iter_mut() {
                *x = *x * factor;
            }
        }
        if let Some(fibre) = &input.fibre {
            add_fibre_tangent(fibre, f, &mut out.tangent[g]);
        }
    }
}

/// The coefficients of δf̄ beside ∇f̄ · V, where f̄ = Π f has `coefficients`. At the points of each group `rate` is δf
/// and `excess` is f − f̄.
#[inline(always)]
fn projected_rate(
    tables: &ElementTables,
    out: &ElementOutput,
    geometry: &Option<[GeometryRate; MAX_GROUPS]>,
    coefficients: &[f64; 4],
    rate: &[Lanes; MAX_GROUPS],
    excess: &[Lanes; MAX_GROUPS],
) -> [f64; 4] {
    let mut found = [0.0; 4];
    for g in 0..tables.groups {
        let mut own = rate[g];
        if let Some(geometry) = geometry {
            own = own - carried(&geometry[g], coefficients) + excess[g] * geometry[g].dilation;
        }
        for m in 0..4 {
            let mut sum = own * out.basis[m][g];
            if let Some(geometry) = geometry {
                sum += excess[g] * geometry[g].basis[m];
            }
            found[m] += (sum * out.volume[g]).sum();
        }
    }
    found
}

/// ∇f̄ · V of the function with these coefficients.
#[inline(always)]
fn carried(geometry: &GeometryRate, coefficients: &[f64; 4]) -> Lanes {
    let mut sum = Lanes::ZERO;
    for m in 0..4 {
        sum += geometry.basis[m] * coefficients[m];
    }
    sum
}

/// δf̄ at the points of group g.
#[inline(always)]
fn rate_at(
    out: &ElementOutput,
    geometry: &Option<[GeometryRate; MAX_GROUPS]>,
    coefficients: &[f64; 4],
    rates: &[f64; 4],
    g: usize,
) -> Lanes {
    let mut sum = match geometry {
        Some(geometry) => carried(&geometry[g], coefficients),
        None => Lanes::ZERO,
    };
    for m in 0..4 {
        sum += out.basis[m][g] * rates[m];
    }
    sum
}

#[inline(always)]
fn geometry_rate<const FMA: bool>(
    tables: &ElementTables,
    velocities: &NodalVector,
    out: &ElementOutput,
) -> [GeometryRate; MAX_GROUPS] {
    let still = GeometryRate { gradient: ZERO_TENSOR, dilation: Lanes::ZERO, basis: [Lanes::ZERO; 4] };
    let mut found = [still; MAX_GROUPS];
    for (g, rate) in found.iter_mut().enumerate().take(tables.groups) {
        rate.gradient = multiply(&gradient_of::<FMA>(tables, velocities, g), &out.inverse_map[g]);
        rate.dilation = rate.gradient[0][0] + rate.gradient[1][1] + rate.gradient[2][2];
        for i in 0..3 {
            let mut speed = Lanes::ZERO;
            for a in 0..tables.num {
                speed = Lanes::splat(velocities[a][i]).mul_add::<FMA>(tables.shape[a][g], speed);
            }
            for m in 0..4 {
                rate.basis[m] += speed * out.basis_slope[m][i];
            }
        }
    }
    found
}

/// The derivative of the residual along one variation.
#[inline(always)]
fn varied<const FMA: bool>(
    tables: &ElementTables,
    input: &ElementInput,
    state: &State,
    variation: &Variation,
    out: &ElementOutput,
) -> NodalVector {
    // No closure: it would be compiled for any processor, where a fused multiply-add is a call.
    let mut geometry = None;
    if let Some(velocities) = &variation.velocities {
        geometry = Some(geometry_rate::<FMA>(tables, velocities, out));
    }
    let lanes = [Lanes::ZERO; MAX_GROUPS];
    let mut delta_f = [ZERO_TENSOR; MAX_GROUPS];
    let (mut rate, mut excess) = (lanes, lanes);
    for g in 0..tables.groups {
        if let Some(displacements) = &variation.displacements {
            delta_f[g] = multiply(&gradient_of::<FMA>(tables, displacements, g), &out.inverse_map[g]);
        }
        if let Some(geometry) = &geometry {
            let mut h = out.deformation_gradient[g];
            for (i, row) in h.iter_mut().enumerate() {
                row[i] = row[i] - 1.0;
            }
            let carried = multiply(&h, &geometry[g].gradient);
            for i in 0..3 {
                for j in 0..3 {
                    delta_f[g][i][j] -= carried[i][j];
                }
            }
        }
        rate[g] = contract(&out.cofactor[g], &delta_f[g]);
        excess[g] = out.jacobian[g] - state.points[g].volume_ratio;
    }
    let [ratio, pressure] = &state.coefficients;
    let ratio_rate = projected_rate(tables, out, &geometry, ratio, &rate, &excess);
    let kappa = input.material.bulk_kpa;
    for g in 0..tables.groups {
        let PointState { volume_ratio, log_ratio, pressure } = state.points[g];
        let slope = log_ratio * kappa / volume_ratio;
        let curvature = (Lanes::splat(1.0) - log_ratio) * kappa / (volume_ratio * volume_ratio);
        let mut own = curvature * rate_at(out, &geometry, ratio, &ratio_rate, g);
        if let Some(growth) = variation.log_growth {
            own -= growth[g] * kappa / volume_ratio;
        }
        if variation.parameter == Some(Parameter::Kappa) {
            own += slope / kappa;
        }
        (rate[g], excess[g]) = (own, slope - pressure);
    }
    let pressure_rate = projected_rate(tables, out, &geometry, pressure, &rate, &excess);
    let mut weighted = [ZERO_TENSOR; MAX_GROUPS];
    for g in 0..tables.groups {
        let delta_p = rate_at(out, &geometry, pressure, &pressure_rate, g);
        let mut s = other_stress_rate(input, variation, out, g);
        if variation.displacements.is_some() || variation.velocities.is_some() {
            for i in 0..3 {
                for j in 0..3 {
                    for k in 0..3 {
                        for l in 0..3 {
                            s[i][j] = out.tangent[g][3 * i + j][3 * k + l].mul_add::<FMA>(delta_f[g][k][l], s[i][j]);
                        }
                    }
                }
            }
        }
        for i in 0..3 {
            for j in 0..3 {
                s[i][j] += delta_p * out.cofactor[g][i][j];
            }
        }
        if let Some(geometry) = &geometry {
            let (l, stress) = (&geometry[g].gradient, &out.stress[g]);
            for i in 0..3 {
                for k in 0..3 {
                    s[i][k] += stress[i][k] * geometry[g].dilation;
                    for j in 0..3 {
                        s[i][k] -= stress[i][j] * l[k][j];
                    }
                }
            }
        }
        weighted[g] = scaled(&s, out.volume[g]);
    }
    let mut found = [[0.0; 3]; MAX_NODES];
    add_internal_force::<FMA>(tables, &out.inverse_map, &weighted, &mut found);
    found
}

/// What the material's parameter, the factor on the stiffness, the law's correction and fibres do to P at fixed F
/// and p.
#[inline(always)]
fn other_stress_rate(input: &ElementInput, variation: &Variation, out: &ElementOutput, g: usize) -> Tensor {
    let f = &out.deformation_gradient[g];
    let mut s = ZERO_TENSOR;
    if let Some(parameter) = variation.parameter {
        let factor = input.stiffness_factor.map_or(Lanes::splat(1.0), |f| f[g]);
        let rate = SpectralState::new(input.material, f).stress_parameter_derivative(input.material, parameter);
        s = scaled(&rate, factor);
    }
    if let Some(rate) = variation.stiffness_factor {
        let mut isochoric = SpectralState::new(input.material, f).first_piola_kirchhoff_stress(Lanes::ZERO);
        if let Some(law) = &input.law {
            add_law_stress(law, f, out.jacobian[g], &out.cofactor[g], &mut isochoric);
        }
        let rate = scaled(&isochoric, rate[g]);
        for i in 0..3 {
            for j in 0..3 {
                s[i][j] += rate[i][j];
            }
        }
    }
    if let Some(law) = &variation.law {
        let mut stress = ZERO_TENSOR;
        add_law_stress(law, f, out.jacobian[g], &out.cofactor[g], &mut stress);
        let rate = scaled(&stress, input.stiffness_factor.map_or(Lanes::splat(1.0), |f| f[g]));
        for i in 0..3 {
            for j in 0..3 {
                s[i][j] += rate[i][j];
            }
        }
    }
    if let Some(difference) = &variation.fibre {
        for (fibre, sign) in difference.ends.iter().zip([1.0, -1.0]) {
            let Some(fibre) = fibre else { continue };
            let mut stress = ZERO_TENSOR;
            add_fibre_stress(fibre, f, &mut stress);
            for i in 0..3 {
                for j in 0..3 {
                    s[i][j] += stress[i][j] * (sign / (2.0 * difference.step));
                }
            }
        }
    }
    s
}
