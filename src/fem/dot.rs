//! The scalar product of two long vectors.

use std::ops::{AddAssign, Mul};

/// Sums side by side: as many additions are under way at a time, where a single sum would wait for each.
const SUMS: usize = 32;

/// Σ aᵢ bᵢ, in an order that depends on the length alone: processors with wider registers add the same numbers in the
/// same order. Entries beyond the shorter vector do not count.
pub(crate) fn dot<T: Copy + Default + AddAssign + Mul<Output = T>>(a: &[T], b: &[T]) -> T {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has what the function was compiled for.
        return unsafe { dot_avx2(a, b) };
    }
    summed(a, b)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn dot_avx2<T: Copy + Default + AddAssign + Mul<Output = T>>(a: &[T], b: &[T]) -> T {
    summed(a, b)
}

#[inline(always)]
fn summed<T: Copy + Default + AddAssign + Mul<Output = T>>(a: &[T], b: &[T]) -> T {
    let mut sums = [T::default(); SUMS];
    let (left, right) = (a.chunks_exact(SUMS), b.chunks_exact(SUMS));
    let whole = SUMS * left.len().min(right.len());
    for (a, b) in left.zip(right) {
        for n in 0..SUMS {
            sums[n] += a[n] * b[n];
        }
    }
    let mut total = T::default();
    for sum in sums {
        total += sum;
    }
    for (&a, &b) in a[whole..].iter().zip(&b[whole..]) {
        total += a * b;
    }
    total
}

#[cfg(test)]
mod tests {
    use super::{dot, summed};

    #[test]
    fn all_entries_count_once() {
        for n in [0, 1, 31, 32, 33, 70, 163] {
            let a: Vec<f64> = (1..=n).map(f64::from).collect();
            let f64_n = f64::from(n);
            // Whole numbers are exact.
            assert_eq!(dot(&a, &a), f64_n * (f64_n + 1.0) * (2.0 * f64_n + 1.0) / 6.0);
            assert_eq!(dot(&a, &a[..a.len() / 2]), dot(&a[..a.len() / 2], &a[..a.len() / 2]));
        }
    }

    #[test]
    fn wider_registers_change_no_bit() {
        let of = |n: usize, k: f64| (0..n).map(|i| (k * i as f64).sin()).collect::<Vec<f64>>();
        for n in [5, 64, 1003] {
            let (a, b) = (of(n, 0.7), of(n, 1.3));
            assert_eq!(dot(&a, &b).to_bits(), summed(&a, &b).to_bits());
        }
    }
}
