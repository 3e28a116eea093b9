//! Graded division of a line.

/// Divides [0, 1] into `n` parts. The size of a part at relative position u is `start`^(1 − u) near a graded start and
/// likewise `end`^u near a graded end, so a ratio of 1 leaves that end alone; with both ends graded each one governs
/// its half. Geometric growth: dividing twice as finely halves every part, and the half of a symmetric division is the
/// division of the half graded at one end.
///
/// Returns `n + 1` positions; the first is exactly 0 and the last exactly 1.
pub(super) fn divide(n: usize, start: f64, end: f64) -> Vec<f64> {
    let n = n.max(1);
    // Ratios of exactly 1 mean "not graded"; then the other end's grading runs over the whole line.
    let (graded_start, graded_end) = (start < 1.0, end < 1.0);
    let mut positions = Vec::with_capacity(n + 1);
    let mut sum = 0.0;
    positions.push(0.0);
    for i in 0..n {
        let u = (i as f64 + 0.5) / n as f64;
        let size = match (graded_start, graded_end) {
            (false, false) => 1.0,
            (true, false) => start.powf(1.0 - u),
            (false, true) => end.powf(u),
            (true, true) => start.powf((1.0 - 2.0 * u).max(0.0)) * end.powf((2.0 * u - 1.0).max(0.0)),
        };
        sum += size;
        positions.push(sum);
    }
    for p in &mut positions {
        *p /= sum;
    }
    positions[n] = 1.0;
    positions
}

/// Positions with their midpoints between: 2n + 1 values from n + 1.
pub(super) fn with_middles(positions: &[f64]) -> Vec<f64> {
    let mut all = Vec::with_capacity(2 * positions.len());
    for pair in positions.windows(2) {
        all.extend([pair[0], 0.5 * (pair[0] + pair[1])]);
    }
    all.extend(positions.last());
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_a_symmetric_division_is_the_one_sided_division() {
        let whole = divide(8, 0.25, 0.25);
        let half = divide(4, 0.25, 1.0);
        for i in 0..=4 {
            // Rounding only.
            assert!((whole[i] - 0.5 * half[i]).abs() < 1e-14);
            assert!((whole[8 - i] - (1.0 - whole[i])).abs() < 1e-14);
        }
    }

    #[test]
    fn sizes_grow_by_the_ratio_and_ends_are_exact() {
        for n in 1..30 {
            let p = divide(n, 0.2, 1.0);
            assert_eq!((p[0], p[n]), (0.0, 1.0));
            assert!(p.windows(2).all(|w| w[1] > w[0]));
        }
        let p = divide(400, 0.2, 1.0);
        // First over last part: 0.2^(1 − 1/400) to rounding.
        assert!(((p[1] - p[0]) / (p[400] - p[399]) - 0.2f64.powf(1.0 - 1.0 / 400.0)).abs() < 1e-10);
        assert_eq!(with_middles(&[0.0, 1.0, 3.0]), [0.0, 0.5, 1.0, 2.0, 3.0]);
    }
}
