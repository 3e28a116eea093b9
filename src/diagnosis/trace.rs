//! What a recording holds, as one vector: voxel displacements and forces of every step.

/// Voxel displacements (mm) and forces (N) per step, or changes of them.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    /// Per step, per compared voxel.
    pub displacement: Vec<Vec<[f64; 3]>>,
    /// Per step; zero where none was recorded.
    pub force: Vec<f64>,
}

impl Trace {
    /// `self` + `factor` × `other`, entry by entry.
    pub fn plus(&self, factor: f64, other: &Trace) -> Trace {
        let mut sum = self.clone();
        for (a, b) in sum.displacement.iter_mut().zip(&other.displacement) {
            for (x, y) in a.iter_mut().zip(b) {
                for c in 0..3 {
                    x[c] += factor * y[c];
                }
            }
        }
        for (a, b) in sum.force.iter_mut().zip(&other.force) {
            *a += factor * b;
        }
        sum
    }

    /// The same times `factor`.
    pub fn scaled(&self, factor: f64) -> Trace {
        let mut out = self.clone();
        out.displacement.iter_mut().flatten().flatten().chain(&mut out.force).for_each(|x| *x *= factor);
        out
    }

    /// Root mean square of the displacement over voxels and components of the steps, mm; NaN entries are left out.
    pub fn rms_mm(&self) -> f64 {
        let (mut sum, mut count) = (0.0, 0usize);
        for x in self.displacement.iter().flatten().flatten().filter(|x| x.is_finite()) {
            sum += x * x;
            count += 1;
        }
        (sum / count.max(1) as f64).sqrt()
    }
}
