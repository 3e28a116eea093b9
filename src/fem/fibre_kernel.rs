//! Stress and tangent of fibres at eight points at a time: Ψ_f = k/2 (I₄ − 1)², I₄ = a·C a.

use super::departures::Fibre;
use crate::material::{Lanes, Tensor};

/// F a and I₄ − 1 = |F a|² − 1.
#[inline(always)]
fn fibre_state(fibre: &Fibre, f: &Tensor) -> ([Lanes; 3], Lanes) {
    let a = fibre.direction;
    let stretched = [0, 1, 2].map(|i| f[i][0] * a[0] + f[i][1] * a[1] + f[i][2] * a[2]);
    let square = stretched[0] * stretched[0] + stretched[1] * stretched[1] + stretched[2] * stretched[2];
    (stretched, square - 1.0)
}

/// Adds ∂Ψ_f/∂F = 2 k (I₄ − 1) F a ⊗ a.
#[inline(always)]
pub(super) fn add_fibre_stress(fibre: &Fibre, f: &Tensor, stress: &mut Tensor) {
    let (stretched, excess) = fibre_state(fibre, f);
    for i in 0..3 {
        for j in 0..3 {
            stress[i][j] += excess * stretched[i] * (2.0 * fibre.modulus_kpa * fibre.direction[j]);
        }
    }
}

/// Adds ∂²Ψ_f/∂F∂F = 4 k (F a ⊗ a) ⊗ (F a ⊗ a) + 2 k (I₄ − 1) δ_ik a_J a_L.
#[inline(always)]
pub(super) fn add_fibre_tangent(fibre: &Fibre, f: &Tensor, tangent: &mut [[Lanes; 9]; 9]) {
    let (stretched, excess) = fibre_state(fibre, f);
    let (a, k) = (fibre.direction, fibre.modulus_kpa);
    for i in 0..3 {
        for j in 0..3 {
            for m in 0..3 {
                for l in 0..3 {
                    let mut t = stretched[i] * stretched[m] * (4.0 * k * a[j] * a[l]);
                    if i == m {
                        t += excess * (2.0 * k * a[j] * a[l]);
                    }
                    tangent[3 * i + j][3 * m + l] += t;
                }
            }
        }
    }
}
