//! The scalar product of two long vectors.

use std::ops::{AddAssign, Mul};

/// Sums side by side: as many additions are under way at a time, where a single sum would wait for each.
const SUMS: usize = 8;

/// Σ aᵢ bᵢ, in an order that depends on the length alone. Entries beyond the shorter vector do not count.
pub(crate) fn dot<T: Copy + Default + AddAssign + Mul<Output = T>>(a: &[T], b: &[T]) -> T {
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
    use super::dot;

    #[test]
    fn all_entries_count_once() {
        for n in [0, 1, 7, 8, 9, 40, 43] {
            let a: Vec<f64> = (1..=n).map(f64::from).collect();
            let f64_n = f64::from(n);
            // Whole numbers are exact.
            assert_eq!(dot(&a, &a), f64_n * (f64_n + 1.0) * (2.0 * f64_n + 1.0) / 6.0);
            assert_eq!(dot(&a, &a[..a.len() / 2]), dot(&a[..a.len() / 2], &a[..a.len() / 2]));
        }
    }
}
