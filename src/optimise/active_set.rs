//! Small quadratic programmes by a primal active-set method, from a feasible rest.

use nalgebra::{DMatrix, DVector};

/// normal·y ≤ room.
pub(super) struct Row {
    /// One coefficient per unknown.
    pub(super) normal: DVector<f64>,
    /// Right side, not negative: rest keeps every limit.
    pub(super) room: f64,
}

/// Minimises ½ yᵀHy − gᵀy subject to normal·y ≤ room with all rooms ≥ 0, so that rest is feasible. H positive definite.
pub(super) fn least_within(matrix: &DMatrix<f64>, gradient: &DVector<f64>, rows: &[Row]) -> DVector<f64> {
    let n = gradient.len();
    if let Some(c) = matrix.clone().cholesky() {
        let y = c.solve(gradient);
        if rows.iter().all(|row| row.normal.dot(&y) <= row.room) {
            return y;
        }
    }
    let mut y = DVector::<f64>::zeros(n);
    let mut active: Vec<usize> = Vec::new();
    // Each turn adds or drops one limit; cycling is possible only by rounding, and then the step so far serves.
    for _ in 0..10 * (rows.len() + 1) {
        let size = n + active.len();
        let mut kkt = DMatrix::zeros(size, size);
        let mut right = DVector::zeros(size);
        kkt.view_mut((0, 0), (n, n)).copy_from(matrix);
        right.rows_mut(0, n).copy_from(&(gradient - matrix * &y));
        for (k, &r) in active.iter().enumerate() {
            for i in 0..n {
                kkt[(n + k, i)] = rows[r].normal[i];
                kkt[(i, n + k)] = rows[r].normal[i];
            }
        }
        let Some(solution) = kkt.lu().solve(&right).filter(|s| s.iter().all(|v| v.is_finite())) else { break };
        let p = solution.rows(0, n).into_owned();
        if p.amax() <= 1e-12 * (1.0 + y.amax()) {
            let worst = (0..active.len()).min_by(|&a, &b| solution[n + a].total_cmp(&solution[n + b]));
            match worst {
                Some(k) if solution[n + k] < -1e-12 * (1.0 + gradient.amax()) => {
                    active.remove(k);
                }
                _ => break,
            }
            continue;
        }
        let mut length = 1.0;
        let mut blocking = None;
        for (r, row) in rows.iter().enumerate() {
            let slope = row.normal.dot(&p);
            if slope > 1e-14 * p.amax() && !active.contains(&r) {
                let part = ((row.room - row.normal.dot(&y)).max(0.0)) / slope;
                if part < length {
                    length = part;
                    blocking = Some(r);
                }
            }
        }
        y += length * p;
        if let Some(r) = blocking {
            active.push(r);
        }
    }
    y
}
