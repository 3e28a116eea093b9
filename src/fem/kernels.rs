//! The element kernels, compiled for the instruction sets that they know and chosen at run time.

use super::element_data::{ElementInput, ElementOutput, ElementTables, Variation};
use super::kernel::{NodalVector, element};
use super::variation_kernel;

/// The kernels, compiled for one instruction set.
#[derive(Clone, Copy)]
pub struct Kernels {
    residual: unsafe fn(&ElementTables, &ElementInput, &mut ElementOutput) -> bool,
    tangent: unsafe fn(&ElementTables, &ElementInput, &mut ElementOutput) -> bool,
    variations: unsafe fn(&ElementTables, &ElementInput, &[Variation], &mut ElementOutput, &mut [NodalVector]) -> bool,
    /// Name of the instruction set.
    pub name: &'static str,
}

macro_rules! compile_for {
    ($module:ident, $fma:literal, $feature:meta) => {
        mod $module {
            use super::*;
            #[$feature]
            pub fn residual(t: &ElementTables, i: &ElementInput, o: &mut ElementOutput) -> bool {
                element::<$fma, false>(t, i, o)
            }
            #[$feature]
            pub fn tangent(t: &ElementTables, i: &ElementInput, o: &mut ElementOutput) -> bool {
                element::<$fma, true>(t, i, o)
            }
            #[$feature]
            pub fn variations(
                t: &ElementTables,
                i: &ElementInput,
                v: &[Variation],
                o: &mut ElementOutput,
                found: &mut [NodalVector],
            ) -> bool {
                variation_kernel::variations::<$fma>(t, i, v, o, found)
            }
        }
    };
}

compile_for!(portable, false, inline(never));
#[cfg(target_arch = "x86_64")]
compile_for!(avx2, true, target_feature(enable = "avx2,fma"));
#[cfg(target_arch = "x86_64")]
compile_for!(avx512, true, target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma"));

impl Kernels {
    /// The best that this processor runs.
    pub fn detect() -> Kernels {
        #[cfg(target_arch = "x86_64")]
        {
            let has_512 = is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx512bw");
            if has_512 && is_x86_feature_detected!("fma") {
                return Kernels {
                    residual: avx512::residual,
                    tangent: avx512::tangent,
                    variations: avx512::variations,
                    name: "avx512",
                };
            }
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                return Kernels {
                    residual: avx2::residual,
                    tangent: avx2::tangent,
                    variations: avx2::variations,
                    name: "avx2",
                };
            }
        }
        Kernels::portable()
    }

    /// Kernels without special instructions.
    pub fn portable() -> Kernels {
        Kernels {
            residual: portable::residual,
            tangent: portable::tangent,
            variations: portable::variations,
            name: "portable",
        }
    }

    /// Condensed residual. False where an element is inverted.
    pub fn residual(&self, tables: &ElementTables, input: &ElementInput, out: &mut ElementOutput) -> bool {
        // SAFETY: `detect` only hands out functions whose instructions this processor has.
        unsafe { (self.residual)(tables, input, out) }
    }

    /// Residual, B and K. False where an element is inverted.
    pub fn tangent(&self, tables: &ElementTables, input: &ElementInput, out: &mut ElementOutput) -> bool {
        // SAFETY: as above.
        unsafe { (self.tangent)(tables, input, out) }
    }

    /// Derivatives of the condensed residual along each of `variations`, into `found`, which is as long. False where an
    /// element is inverted. The state's pressure must be the condensed one (`input.pressure` = `None`).
    pub fn variations(
        &self,
        tables: &ElementTables,
        input: &ElementInput,
        variations: &[Variation],
        out: &mut ElementOutput,
        found: &mut [NodalVector],
    ) -> bool {
        // SAFETY: as above.
        unsafe { (self.variations)(tables, input, variations, out, found) }
    }
}
