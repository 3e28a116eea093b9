//! Eight double-precision numbers worked on together.
//!
//! Plain loops over `[f64; 8]`, which the compiler turns into vector instructions inside functions that enable them
//! (see [`crate::fem`]'s kernels). Nothing here branches on data.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// Number of lanes.
pub const LANES: usize = 8;

/// Eight numbers.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Lanes(pub [f64; LANES]);

macro_rules! lanewise {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for Lanes {
            type Output = Lanes;
            #[inline(always)]
            fn $method(mut self, other: Lanes) -> Lanes {
                for l in 0..LANES {
                    self.0[l] = self.0[l] $op other.0[l];
                }
                self
            }
        }
        impl $trait<f64> for Lanes {
            type Output = Lanes;
            #[inline(always)]
            fn $method(mut self, other: f64) -> Lanes {
                for l in 0..LANES {
                    self.0[l] = self.0[l] $op other;
                }
                self
            }
        }
    };
}
lanewise!(Add, add, +);
lanewise!(Sub, sub, -);
lanewise!(Mul, mul, *);
lanewise!(Div, div, /);

impl Neg for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn neg(mut self) -> Lanes {
        for l in 0..LANES {
            self.0[l] = -self.0[l];
        }
        self
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Lanes) {
        for l in 0..LANES {
            self.0[l] += other.0[l];
        }
    }
}

impl SubAssign for Lanes {
    #[inline(always)]
    fn sub_assign(&mut self, other: Lanes) {
        for l in 0..LANES {
            self.0[l] -= other.0[l];
        }
    }
}

impl Lanes {
    /// All lanes zero.
    pub const ZERO: Lanes = Lanes([0.0; LANES]);

    /// The same number in every lane.
    #[inline(always)]
    pub fn splat(x: f64) -> Lanes {
        Lanes([x; LANES])
    }

    /// Reads eight numbers.
    #[inline(always)]
    pub fn load(x: &[f64]) -> Lanes {
        let mut r = [0.0; LANES];
        r.copy_from_slice(&x[..LANES]);
        Lanes(r)
    }

    /// `self · b + c`, fused where `FMA` (which must only be set where the processor has it: the fallback of
    /// `f64::mul_add` is a slow library call).
    #[inline(always)]
    pub fn mul_add<const FMA: bool>(mut self, b: Lanes, c: Lanes) -> Lanes {
        for l in 0..LANES {
            self.0[l] = if FMA { self.0[l].mul_add(b.0[l], c.0[l]) } else { self.0[l] * b.0[l] + c.0[l] };
        }
        self
    }

    /// Square root of each lane.
    #[inline(always)]
    pub fn sqrt(mut self) -> Lanes {
        for l in 0..LANES {
            self.0[l] = self.0[l].sqrt();
        }
        self
    }

    /// Absolute value of each lane.
    #[inline(always)]
    pub fn abs(mut self) -> Lanes {
        for l in 0..LANES {
            self.0[l] = self.0[l].abs();
        }
        self
    }

    /// Sum of the lanes, in a fixed order.
    #[inline(always)]
    pub fn sum(self) -> f64 {
        let a = self.0;
        ((a[0] + a[4]) + (a[1] + a[5])) + ((a[2] + a[6]) + (a[3] + a[7]))
    }

    /// Smallest lane; NaN if any lane is NaN.
    #[inline(always)]
    pub fn min(self) -> f64 {
        let mut m = self.0[0];
        for l in 1..LANES {
            let x = self.0[l];
            m = if x < m || x.is_nan() { x } else { m };
        }
        m
    }

    /// Lane by lane: `if condition < limit { a } else { b }`.
    #[inline(always)]
    pub fn select_below(condition: Lanes, limit: f64, a: Lanes, b: Lanes) -> Lanes {
        let mut r = b;
        for l in 0..LANES {
            r.0[l] = if condition.0[l] < limit { a.0[l] } else { b.0[l] };
        }
        r
    }

    /// eˣ; relative error below 3·10⁻¹⁶ for |x| ≤ 700, clamped beyond.
    ///
    /// x = n ln 2 + r, |r| ≤ ½ ln 2 (Cody–Waite), eʳ by its Taylor polynomial of degree 13 (remainder 4·10⁻¹⁸).
    #[inline(always)]
    pub fn exp(self) -> Lanes {
        const LN2_HI: f64 = 6.931_471_803_691_238e-1;
        const LN2_LO: f64 = 1.908_214_929_270_587_7e-10;
        // Adding 1.5·2⁵² rounds to an integer in the low bits of the mantissa.
        const SHIFT: f64 = 6_755_399_441_055_744.0;
        let mut out = self;
        for l in 0..LANES {
            let x = self.0[l].clamp(-700.0, 700.0);
            let shifted = x * std::f64::consts::LOG2_E + SHIFT;
            let n = shifted - SHIFT;
            let r = (x - n * LN2_HI) - n * LN2_LO;
            let mut p = 1.0 / 6_227_020_800.0;
            for c in [
                1.0 / 479_001_600.0,
                1.0 / 39_916_800.0,
                1.0 / 3_628_800.0,
                1.0 / 362_880.0,
                1.0 / 40_320.0,
                1.0 / 5_040.0,
                1.0 / 720.0,
                1.0 / 120.0,
                1.0 / 24.0,
                1.0 / 6.0,
                0.5,
                1.0,
                1.0,
            ] {
                p = p * r + c;
            }
            let scale = f64::from_bits((shifted.to_bits().wrapping_add(1023)) << 52);
            out.0[l] = p * scale;
        }
        out
    }

    /// ln x for normal positive x; relative error below 10⁻¹⁵ (absolute 2·10⁻¹⁶ near x = 1).
    ///
    /// x = 2ⁿ m with m ∈ [√½, √2); ln m = 2 artanh((m − 1)/(m + 1)) by its odd series to degree 21.
    #[inline(always)]
    pub fn ln(self) -> Lanes {
        const SQRT_HALF_BITS: u64 = 0x3fe6_a09e_667f_3bcd;
        // 2⁵² + 2⁵¹: an integer placed in the mantissa is read back by subtracting it, without a conversion.
        const INTEGER: f64 = 6_755_399_441_055_744.0;
        let mut out = self;
        for l in 0..LANES {
            let bits = self.0[l].to_bits();
            let shift = bits.wrapping_sub(SQRT_HALF_BITS);
            // Arithmetic shift of a 64-bit integer by 52, as a number: n.
            let n_int = (shift as i64) >> 52;
            let m = f64::from_bits(bits.wrapping_sub((n_int << 52) as u64));
            let n = f64::from_bits(INTEGER.to_bits().wrapping_add(n_int as u64)) - INTEGER;
            let s = (m - 1.0) / (m + 1.0);
            let z = s * s;
            let mut p = 1.0 / 21.0;
            for c in
                [1.0 / 19.0, 1.0 / 17.0, 1.0 / 15.0, 1.0 / 13.0, 1.0 / 11.0, 1.0 / 9.0, 1.0 / 7.0, 1.0 / 5.0, 1.0 / 3.0]
            {
                p = p * z + c;
            }
            let ln_m = 2.0 * s + 2.0 * s * z * p;
            out.0[l] = n * 6.931_471_803_691_238e-1 + (ln_m + n * 1.908_214_929_270_587_7e-10);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the standard library, which is correct to one unit in the last place (1.1e-16); ours adds a few.
    #[test]
    fn exp_and_ln_agree_with_the_standard_library() {
        for i in 0..4000 {
            let x = (i as f64 - 2000.0) * 0.0173;
            let e = Lanes::splat(x).exp().0[3];
            assert!((e / x.exp() - 1.0).abs() < 1e-15, "exp({x}) = {e}");
            let y = (x * 0.1).exp();
            let l = Lanes::splat(y).ln().0[5];
            assert!((l - y.ln()).abs() < 4e-16 * (1.0 + y.ln().abs()), "ln({y}) = {l}");
        }
    }
}
