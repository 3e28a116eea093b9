//! What the second derivatives of the residuals add to a Gauss–Newton matrix, learnt from the gradients on the way.
//!
//! Where a model cannot follow the data, the residuals stay large. What H = JᵀJ leaves out of the second derivatives of
//! the objective, S = Σ rₖ ∇²rₖ, then makes Gauss–Newton's steps too long or too short: they approach the optimum by
//! the same factor each time. S is learnt as by Dennis, Gay and Welsch (NL2SOL, ACM Trans. Math. Softw. 7 (1981),
//! 348–368): the least change of what is known of it that explains how the gradient changed along the last step.
//! Whether H or H + S is the model of the next step is decided by which foretold the last one better.

use nalgebra::{DMatrix, DVector};

/// A point on the way of a descent of the objective f.
#[derive(Clone, Copy, Debug)]
pub struct OnTheWay<'a> {
    /// f.
    pub objective: f64,
    /// −½∇f.
    pub gradient: &'a DVector<f64>,
    /// H ≈ ½∇²f.
    pub matrix: &'a DMatrix<f64>,
}

/// S, as far as it is known.
#[derive(Clone, Debug)]
pub struct Secant {
    matrix: DMatrix<f64>,
    foretells: bool,
}

/// Where a step promises less than this part of the objective, rounding of derivatives may be most of how the gradient
/// changes along it: derivatives by loosely solved equilibria are good to 10⁻⁴.
const TOLD_ABOVE: f64 = 1e-6;
/// H + S is a model where it is at least this part of H in every direction.
const LEAST_PART: f64 = 0.1;
/// Nothing is learnt of a step along which the gradient changed by less than this part of what H foretold: it would be
/// divided by.
const LEAST_CHANGE: f64 = 0.01;

impl Secant {
    /// Nothing is known yet of a problem of `num` unknowns.
    pub fn unknown(num: usize) -> Secant {
        Secant { matrix: DMatrix::zeros(num, num), foretells: false }
    }

    /// Learns from a step that was taken.
    pub fn learn(&mut self, step: &DVector<f64>, [before, after]: [OnTheWay; 2]) {
        let along = |matrix: &DMatrix<f64>| step.dot(&(matrix * step));
        let length = along(before.matrix);
        if !(length > TOLD_ABOVE * after.objective) {
            return;
        }
        let of_gauss_newton = 2.0 * before.gradient.dot(step) - length;
        let gain = before.objective - after.objective;
        let told_by = |extra: f64| (gain - (of_gauss_newton - extra)).abs();
        self.foretells = told_by(along(&self.matrix)) < told_by(0.0);
        // (H + S) step, H the mean along the step.
        let whole = before.gradient - after.gradient;
        let wanted = &whole - 0.5 * (before.matrix + after.matrix) * step;
        let slope = whole.dot(step);
        if !(slope > LEAST_CHANGE * length) {
            return;
        }
        let known = along(&self.matrix);
        if known != 0.0 {
            self.matrix *= (step.dot(&wanted) / known).abs().min(1.0);
        }
        let lacking = wanted - &self.matrix * step;
        let both = &lacking * whole.transpose();
        self.matrix += (&both + both.transpose()) / slope;
        self.matrix -= &whole * whole.transpose() * (lacking.dot(step) / (slope * slope));
    }

    /// The model of the next step from where Gauss–Newton's is `matrix`: that one with S, where S foretold the last
    /// step better than nothing and the two together have a least.
    pub fn added_to(&self, matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let is_model = self.foretells && (matrix * (1.0 - LEAST_PART) + &self.matrix).cholesky().is_some();
        is_model.then(|| matrix + &self.matrix)
    }

    /// After a step that failed: Gauss–Newton's model until S foretells better again.
    pub fn distrust(&mut self) {
        self.foretells = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// r = (x² − 3, y² + x − 2, 4 − x y): no zero, and Gauss–Newton approaches the optimum by a constant factor.
    fn point(x: &DVector<f64>) -> (f64, DVector<f64>, DMatrix<f64>) {
        let (a, b) = (x[0], x[1]);
        let r = DVector::from_vec(vec![a * a - 3.0, b * b + a - 2.0, 4.0 - a * b]);
        let j = DMatrix::from_row_slice(3, 2, &[2.0 * a, 0.0, 1.0, 2.0 * b, -b, -a]);
        (r.norm_squared(), -(j.transpose() * &r), j.transpose() * j)
    }

    /// Norms of the gradient from step to step, with S or without.
    fn way(learns: bool) -> Vec<f64> {
        let mut x = DVector::from_vec(vec![1.7, 1.5]);
        let mut secant = Secant::unknown(2);
        let mut norms = Vec::new();
        for _ in 0..40 {
            let (f, g, h) = point(&x);
            norms.push(g.norm());
            if g.norm() < 1e-9 {
                break;
            }
            let model = secant.added_to(&h).filter(|_| learns).unwrap_or(h.clone());
            let step = model.cholesky().unwrap().solve(&g);
            let next = &x + &step;
            let (f_next, g_next, h_next) = point(&next);
            let before = OnTheWay { objective: f, gradient: &g, matrix: &h };
            let after = OnTheWay { objective: f_next, gradient: &g_next, matrix: &h_next };
            secant.learn(&step, [before, after]);
            x = next;
        }
        norms
    }

    /// With what is learnt on the way the same optimum takes at most half as many steps, and the last ones gain more
    /// and more.
    #[test]
    fn large_residuals_no_longer_slow_the_descent() {
        let [plain, learnt] = [way(false), way(true)];
        assert!(learnt.last().unwrap() < &1e-6, "{learnt:?}");
        assert!(2 * learnt.len() <= plain.len(), "{plain:?} {learnt:?}");
    }

    /// Where residuals are linear nothing is learnt, and the model stays Gauss–Newton's.
    #[test]
    fn nothing_is_learnt_of_a_linear_problem() {
        let h = DMatrix::from_row_slice(2, 2, &[3.0, 1.0, 1.0, 2.0]);
        let mut secant = Secant::unknown(2);
        let g = DVector::from_vec(vec![1.0, -2.0]);
        let step = DVector::from_vec(vec![0.5, 0.3]);
        let after_g = &g - &h * &step;
        let gain = 2.0 * g.dot(&step) - step.dot(&(&h * &step));
        let before = OnTheWay { objective: 10.0, gradient: &g, matrix: &h };
        let after = OnTheWay { objective: 10.0 - gain, gradient: &after_g, matrix: &h };
        secant.learn(&step, [before, after]);
        assert!(secant.matrix.amax() < 1e-14 && secant.added_to(&h).is_none());
    }
}
