//! Ogden stress and tangent at eight points at once.
//!
//! With x_a = ln λ_a² (eigenvalues of C), e_ap = μ_p exp(α_p/2 (x_a − x̄)), m_p = mean_a e_ap:
//! τ_a = Σ_p (e_ap − m_p) + p, P = Σ_a τ_a/λ_a n̂_a ⊗ n_a, with p the pressure-like (Kirchhoff) stress: κ ln J
//! at a point, J times the element's pressure in the mixed formulation.
//! The tangent in the principal frame has the blocks
//!
//! * normal: ∂P_a/∂λ_b = (∂τ_a/∂ln λ_b − τ_a δ_ab)/(λ_a λ_b),
//! * shear: Â_abab = s_b + λ_a² g, Â_abba = λ_a λ_b g, with s_a = τ_a/λ_a², g = (s_a − s_b)/(λ_a² − λ_b²).
//!
//! A law W(Ī₁ − 3) adds what a term of exponent 2 and modulus 2 W′ would, and 4 W″ d_a d_b to ∂τ_a/∂ln λ_b with
//! d_a = λ̄_a² − mean λ̄². What it has of the second invariant is a term of exponent −2.
//!
//! For nearly equal stretches g is written as λ_b⁻⁴ [Σ_p e_bp R(α_p/2 − 1, d) − m R(−1, d)] with d = x_a − x_b and
//! R(c, d) = expm1(c d)/expm1(d) → c, expanded about d = 0: exact in the limit, no perturbation of eigenvalues.

use super::invariant_law::SECOND_EXPONENT;
use super::lanes::Lanes;
use super::{Material, Parameter};

/// Most Ogden terms that a material may have.
pub const MAX_TERMS: usize = 6;

/// A second-order tensor at eight points, `[row][column]`.
pub type Tensor = [[Lanes; 3]; 3];

/// The spectral state at eight points, from which stress, tangent and parameter derivatives follow.
pub struct SpectralState {
    /// λ_a.
    stretch: [Lanes; 3],
    /// x_a − x̄.
    centred_log: [Lanes; 3],
    /// n_a: `[component][a]`.
    reference_axes: Tensor,
    /// n̂_a: `[component][a]`.
    current_axes: Tensor,
    /// e_ap.
    power: [[Lanes; 3]; MAX_TERMS],
    /// m_p.
    mean_power: [Lanes; MAX_TERMS],
    /// Isochoric τ_a, without the pressure.
    tau: [Lanes; 3],
    /// Of a law in the first invariant.
    law: Option<LawState>,
}

/// What a law in the first invariant adds to a state.
struct LawState {
    /// x = Ī₁ − 3.
    x: Lanes,
    /// d_a = λ̄_a² − mean λ̄².
    deviator: [Lanes; 3],
    /// e_a = 2 W′ λ̄_a² and their mean.
    power: [Lanes; 3],
    mean_power: Lanes,
    /// 4 W″.
    stiffening: Lanes,
    /// Of the second invariant.
    second: Option<SecondState>,
}

/// What a term of exponent −2 adds to the state of a law.
struct SecondState {
    /// λ̄_a⁻² less their mean.
    deviator: [Lanes; 3],
    /// e_a and their mean.
    power: [Lanes; 3],
    mean_power: Lanes,
}

/// The exponent of the term that a law in the first invariant acts like.
const LAW_EXPONENT: f64 = 2.0;

impl SpectralState {
    /// The isochoric principal logarithmic stretches x_a − x̄.
    pub(super) fn centred_logs(&self) -> [Lanes; 3] {
        self.centred_log
    }

    /// Decomposes F (det F > 0).
    #[inline(always)]
    pub fn new(material: &Material, deformation_gradient: &Tensor) -> SpectralState {
        let f = deformation_gradient;
        let mut c = [[Lanes::ZERO; 3]; 3];
        for a in 0..3 {
            for b in a..3 {
                c[a][b] = f[0][a] * f[0][b] + f[1][a] * f[1][b] + f[2][a] * f[2][b];
                c[b][a] = c[a][b];
            }
        }
        let n = jacobi(&mut c);
        let squared = [c[0][0], c[1][1], c[2][2]];
        let mut state = SpectralState {
            stretch: [squared[0].sqrt(), squared[1].sqrt(), squared[2].sqrt()],
            centred_log: [squared[0].ln(), squared[1].ln(), squared[2].ln()],
            reference_axes: n,
            current_axes: [[Lanes::ZERO; 3]; 3],
            power: [[Lanes::ZERO; 3]; MAX_TERMS],
            mean_power: [Lanes::ZERO; MAX_TERMS],
            tau: [Lanes::ZERO; 3],
            law: None,
        };
        let mean = (state.centred_log[0] + state.centred_log[1] + state.centred_log[2]) * (1.0 / 3.0);
        for a in 0..3 {
            state.centred_log[a] = state.centred_log[a] - mean;
            for i in 0..3 {
                state.current_axes[i][a] =
                    (f[i][0] * n[0][a] + f[i][1] * n[1][a] + f[i][2] * n[2][a]) / state.stretch[a];
            }
        }
        for (p, term) in material.terms.iter().take(MAX_TERMS).enumerate() {
            for a in 0..3 {
                state.power[p][a] = (state.centred_log[a] * (0.5 * term.alpha)).exp() * term.mu_kpa;
            }
            let e = state.power[p];
            state.mean_power[p] = (e[0] + e[1] + e[2]) * (1.0 / 3.0);
            for a in 0..3 {
                state.tau[a] += e[a] - state.mean_power[p];
            }
        }
        if let Some(law) = &material.law {
            let squared = state.centred_log.map(|x| x.exp());
            let sum = squared[0] + squared[1] + squared[2];
            let (x, mean) = (sum - 3.0, sum * (1.0 / 3.0));
            let [slope, second] = law.slopes(x);
            let deviator = squared.map(|s| s - mean);
            let power = squared.map(|s| s * slope * 2.0);
            for (tau, d) in state.tau.iter_mut().zip(deviator) {
                *tau += d * slope * 2.0;
            }
            let of_second = law.second_mu_kpa().map(|mu_kpa| {
                let inverse = squared.map(|s| Lanes::splat(1.0) / s);
                let mean = (inverse[0] + inverse[1] + inverse[2]) * (1.0 / 3.0);
                let deviator = inverse.map(|s| s - mean);
                for (tau, d) in state.tau.iter_mut().zip(deviator) {
                    *tau += d * mu_kpa;
                }
                SecondState { deviator, power: inverse.map(|s| s * mu_kpa), mean_power: mean * mu_kpa }
            });
            state.law = Some(LawState {
                x,
                deviator,
                power,
                mean_power: mean * slope * 2.0,
                stiffening: second * 4.0,
                second: of_second,
            });
        }
        state
    }

    /// The same state seen from other reference coordinates ξ, `map` being ∂ξ_c/∂X_J: its stress and its tangent are
    /// P and ∂P/∂F with c in place of J, and d in place of L.
    #[inline(always)]
    pub fn pulled_back(mut self, map: &Tensor) -> SpectralState {
        let axes = self.reference_axes;
        for c in 0..3 {
            for a in 0..3 {
                self.reference_axes[c][a] = map[c][0] * axes[0][a] + map[c][1] * axes[1][a] + map[c][2] * axes[2][a];
            }
        }
        self
    }

    /// α_p, e_ap and m_p of all terms, and of the terms that a law acts like.
    #[inline(always)]
    fn powers<'a>(&'a self, material: &'a Material) -> impl Iterator<Item = (f64, &'a [Lanes; 3], Lanes)> {
        let of_terms = material.terms.iter().take(MAX_TERMS).enumerate();
        of_terms
            .map(|(p, term)| (term.alpha, &self.power[p], self.mean_power[p]))
            .chain(self.law.iter().map(|law| (LAW_EXPONENT, &law.power, law.mean_power)))
            .chain(
                self.law
                    .iter()
                    .filter_map(|law| law.second.as_ref())
                    .map(|second| (SECOND_EXPONENT, &second.power, second.mean_power)),
            )
    }

    /// P (kPa) with the pressure-like stress `pressure` (kPa).
    #[inline(always)]
    pub fn first_piola_kirchhoff_stress(&self, pressure: Lanes) -> Tensor {
        self.assemble_coaxial([self.tau[0] + pressure, self.tau[1] + pressure, self.tau[2] + pressure])
    }

    /// ∂P/∂ξ at fixed F and fixed pressure (zero for κ).
    #[inline(always)]
    pub fn stress_parameter_derivative(&self, material: &Material, parameter: Parameter) -> Tensor {
        let mut d = [Lanes::ZERO; 3];
        match parameter {
            Parameter::Kappa => {}
            Parameter::Mu(p) => {
                for a in 0..3 {
                    d[a] = (self.power[p][a] - self.mean_power[p]) * (1.0 / material.terms[p].mu_kpa);
                }
            }
            Parameter::Alpha(p) => {
                for a in 0..3 {
                    d[a] = self.power[p][a] * self.centred_log[a] * 0.5;
                }
                let mean = (d[0] + d[1] + d[2]) * (1.0 / 3.0);
                for x in &mut d {
                    *x = *x - mean;
                }
            }
            Parameter::Law(parameter) => {
                if let (Some(law), Some(state)) = (&material.law, &self.law) {
                    let rate = law.slope_derivative(parameter, state.x) * 2.0;
                    d = state.deviator.map(|x| x * rate);
                    if let Some(second) = &state.second {
                        let rate = law.second_mu_derivative(parameter);
                        for (d, x) in d.iter_mut().zip(second.deviator) {
                            *d += x * rate;
                        }
                    }
                }
            }
        }
        self.assemble_coaxial(d)
    }

    /// Σ_a τ_a/λ_a n̂_a ⊗ n_a.
    #[inline(always)]
    fn assemble_coaxial(&self, tau: [Lanes; 3]) -> Tensor {
        let mut out = [[Lanes::ZERO; 3]; 3];
        for a in 0..3 {
            let s = tau[a] / self.stretch[a];
            for i in 0..3 {
                let left = self.current_axes[i][a] * s;
                for j in 0..3 {
                    out[i][j] += left * self.reference_axes[j][a];
                }
            }
        }
        out
    }

    /// ∂P/∂F (kPa) with the pressure-like stress `pressure` and its derivative with respect to ln J, `pressure_rate`:
    /// `out[3 i + J][3 k + L]`, both triangles filled.
    #[inline(always)]
    pub fn material_tangent<const FMA: bool>(
        &self,
        material: &Material,
        pressure: Lanes,
        pressure_rate: Lanes,
        out: &mut [[Lanes; 9]; 9],
    ) {
        let inverse = [1.0, 1.0, 1.0].map(Lanes::splat);
        let inverse = [inverse[0] / self.stretch[0], inverse[1] / self.stretch[1], inverse[2] / self.stretch[2]];
        let squared =
            [self.stretch[0] * self.stretch[0], self.stretch[1] * self.stretch[1], self.stretch[2] * self.stretch[2]];
        // ∂τ_a/∂ln λ_b = Σ_p α_p [e_a δ_ab − (e_a + e_b)/3 + m/3].
        let mut normal = [[Lanes::ZERO; 3]; 3];
        let mut mean = Lanes::ZERO;
        for (exponent, e, mean_power) in self.powers(material) {
            mean += mean_power;
            for a in 0..3 {
                for b in a..3 {
                    let mut d = (mean_power - e[a] - e[b]) * (1.0 / 3.0);
                    if a == b {
                        d += e[a];
                    }
                    normal[a][b] += d * exponent;
                }
            }
        }
        if let Some(law) = &self.law {
            for a in 0..3 {
                for b in a..3 {
                    normal[a][b] += law.deviator[a] * law.deviator[b] * law.stiffening;
                }
            }
        }
        for a in 0..3 {
            normal[a][a] -= self.tau[a] + pressure;
            for b in a..3 {
                normal[a][b] = (normal[a][b] + pressure_rate) * inverse[a] * inverse[b];
                normal[b][a] = normal[a][b];
            }
        }
        let mut v = [[[Lanes::ZERO; 9]; 3]; 3];
        for a in 0..3 {
            for b in 0..3 {
                for i in 0..3 {
                    for j in 0..3 {
                        v[a][b][3 * i + j] = self.current_axes[i][a] * self.reference_axes[j][b];
                    }
                }
            }
        }
        for row in out.iter_mut() {
            *row = [Lanes::ZERO; 9];
        }
        for a in 0..3 {
            let mut w = [Lanes::ZERO; 9];
            for b in 0..3 {
                for m in 0..9 {
                    w[m] = normal[a][b].mul_add::<FMA>(v[b][b][m], w[m]);
                }
            }
            rank_one::<FMA>(&w, &v[a][a], out);
        }
        for (a, b) in [(0, 1), (0, 2), (1, 2)] {
            let s = [self.tau[a] * inverse[a] * inverse[a], self.tau[b] * inverse[b] * inverse[b]];
            let d = self.centred_log[a] - self.centred_log[b];
            let difference = squared[a] - squared[b];
            // The quotient's rounding error is 1e-16/|d|; the series' truncation (|α d| ≤ 0.02) is below 1e-15.
            const NEAR: f64 = 1e-3;
            let guarded = Lanes::select_below(d.abs(), NEAR, Lanes::splat(1.0), difference);
            let quotient = (s[0] - s[1]) / guarded;
            let mut series = mean * divided_expm1(-1.0, d);
            series = -series;
            for (exponent, e, _) in self.powers(material) {
                series += e[b] * divided_expm1(0.5 * exponent - 1.0, d);
            }
            let inverse_fourth = inverse[b] * inverse[b] * inverse[b] * inverse[b];
            let g = Lanes::select_below(d.abs(), NEAR, series * inverse_fourth, quotient);
            // The pressure adds −p/(λ_a² λ_b²) to g and p/λ_b² to s_b, which cancel in Â_abab.
            let abab = s[1] + squared[a] * g;
            let baba = s[0] + squared[b] * g;
            let abba = self.stretch[a] * self.stretch[b] * g - pressure * inverse[a] * inverse[b];
            let (mut w_ab, mut w_ba) = ([Lanes::ZERO; 9], [Lanes::ZERO; 9]);
            for m in 0..9 {
                w_ab[m] = abab.mul_add::<FMA>(v[a][b][m], abba * v[b][a][m]);
                w_ba[m] = baba.mul_add::<FMA>(v[b][a][m], abba * v[a][b][m]);
            }
            rank_one::<FMA>(&w_ab, &v[a][b], out);
            rank_one::<FMA>(&w_ba, &v[b][a], out);
        }
        for m in 0..9 {
            for n in 0..m {
                out[m][n] = out[n][m];
            }
        }
    }
}

/// Adds the upper triangle of w ⊗ v.
#[inline(always)]
fn rank_one<const FMA: bool>(w: &[Lanes; 9], v: &[Lanes; 9], out: &mut [[Lanes; 9]; 9]) {
    for m in 0..9 {
        for n in m..9 {
            out[m][n] = w[m].mul_add::<FMA>(v[n], out[m][n]);
        }
    }
}

/// expm1(c d)/expm1(d) for small d: c · [sinh(c y)/(c y)]/[sinh(y)/y] · e^((c−1) y), y = d/2.
#[inline(always)]
fn divided_expm1(c: f64, d: Lanes) -> Lanes {
    let y = d * 0.5;
    let sinhc = |z: Lanes| {
        let z2 = z * z;
        ((z2 * (1.0 / 120.0) + 1.0 / 6.0) * z2) + 1.0
    };
    let z = y * (c - 1.0);
    let e = ((((z * (1.0 / 120.0) + 1.0 / 24.0) * z + 1.0 / 6.0) * z + 0.5) * z + 1.0) * z + 1.0;
    sinhc(y * c) / sinhc(y) * e * c
}

/// Eigenvectors (columns) of a symmetric tensor by cyclic Jacobi rotations; the eigenvalues end on its diagonal.
/// Four sweeps leave off-diagonals below 10⁻¹⁵ of the norm (the convergence is quadratic at least).
#[inline(always)]
fn jacobi(c: &mut Tensor) -> Tensor {
    let (zero, one) = (Lanes::ZERO, Lanes::splat(1.0));
    let mut n = [[one, zero, zero], [zero, one, zero], [zero, zero, one]];
    for _ in 0..4 {
        for (p, q, r) in [(0, 1, 2), (0, 2, 1), (1, 2, 0)] {
            let off = c[p][q];
            let delta = c[q][q] - c[p][p];
            let root = (delta * delta + off * off * 4.0).sqrt();
            let magnitude = off * 2.0 / (delta.abs() + root + f64::MIN_POSITIVE);
            let t = Lanes::select_below(delta, 0.0, -magnitude, magnitude);
            let cosine = one / (t * t + 1.0).sqrt();
            let sine = t * cosine;
            c[p][p] -= t * off;
            c[q][q] += t * off;
            c[p][q] = zero;
            c[q][p] = zero;
            let (x, y) = (c[p][r], c[q][r]);
            c[p][r] = cosine * x - sine * y;
            c[q][r] = sine * x + cosine * y;
            c[r][p] = c[p][r];
            c[r][q] = c[q][r];
            for row in &mut n {
                let (x, y) = (row[p], row[q]);
                row[p] = cosine * x - sine * y;
                row[q] = sine * x + cosine * y;
            }
        }
    }
    n
}
