//! The inner part of a sample between two planes along its bonded faces, with what was measured there imposed on it.
//!
//! Whatever the plates, the glue and the ends of the bonds did, the silicone between the two planes was driven by the
//! displacement of these planes, and that was measured. A model of this part therefore knows nothing of the set-up, and
//! what it leaves is the material's or the scan's.
//!
//! The displacement of a plane is a polynomial over it, fitted to the voxels beside it (with the slope across the plane
//! free), whose noise it averages.

use super::error::CalibrationError;
use super::observed::{Observed, ObservedStep};
use crate::fem::VectorField;
use crate::mesh::half_extents_mm;
use crate::recording::Filter;
use crate::specimen::{Outline, Specimen, TestKind};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// What moves the boundary of the model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Boundary {
    /// The plates, as commanded.
    #[default]
    Commanded,
    /// The displacement measured on two planes inside the sample; only what lies between them is compared.
    Measured,
}

/// Degree of a plane's polynomial.
const DEGREE: usize = 8;
/// Degree of the polynomial by which the displacement changes across the plane.
const SLOPE_DEGREE: usize = 4;
/// Voxels whose centre is within this many voxels of a plane are fitted.
const REACH_VOXELS: f64 = 1.6;
/// The part of the sample's extent across its bonded faces that is cut off at each face, where nothing is said.
pub const CUT_PART: f64 = 0.17;
/// Fewest voxels per coefficient of a plane.
const FEWEST: usize = 3;
/// Added to the normal matrix' diagonal, relative to it: coefficients that no voxel tells stay near zero.
const RIDGE: f64 = 1e-6;

impl Observed {
    /// The recording of the part between two planes, each `cut_part` of the extent away from its bonded face, with the
    /// displacement measured there imposed on it. Steps at rest are left out.
    ///
    /// # Errors
    /// [`CalibrationError::NoMeasuredBoundary`] where the sample is no block or a wedge, the values are filtered, or
    /// too few voxels lie beside the planes; [`CalibrationError::Voxel`] where none lies between them;
    /// [`CalibrationError::NeedsVolume`] where cameras measured a face.
    pub fn between_measured_planes(&self, cut_part: f64) -> Result<Observed, CalibrationError> {
        let axis = match self.specimen.test {
            TestKind::DoubleLapShear => 1,
            TestKind::Uniaxial => 0,
        };
        self.check_volume("a boundary measured inside the sample")?;
        if self.specimen.outline != Outline::Block {
            return Err(CalibrationError::NoMeasuredBoundary { reason: "the sample is no block" });
        }
        if !self.specimen.block.taper().is_even() {
            return Err(CalibrationError::NoMeasuredBoundary { reason: "the sample is a wedge" });
        }
        if self.filter != Filter::None {
            return Err(CalibrationError::NoMeasuredBoundary { reason: "the scan's filter reaches across the planes" });
        }
        let plane_mm = (1.0 - 2.0 * cut_part) * half_extents_mm(&self.specimen)[axis];
        let specimen = cut_specimen(&self.specimen, axis, plane_mm)?;
        let grid = &self.mask.grid;
        let reach = plane_mm - 0.5 * grid.voxel_mm[axis] + 1e-9;
        let is_between = |voxel: u32| grid.center_mm(voxel as usize)[axis].abs() <= reach;
        let is_kept: Vec<bool> = self.mask.voxels.iter().map(|&v| is_between(v)).collect();
        let mut steps = Vec::new();
        for step in self.steps.iter().filter(|s| s.drive_mm.abs() > 1e-6) {
            let faces = [-plane_mm, plane_mm].map(|at| self.plane_displacement(step, axis, at));
            let [fixed, moved] = faces;
            steps.push((step, [fixed?, moved?]));
        }
        let flags = self.mask.spread(&is_kept, false);
        let mut part = self.with_mask(specimen, &flags)?;
        let places = self.mask.spread(&(0..self.mask.num_voxels() as u32).collect::<Vec<_>>(), u32::MAX);
        part.steps = steps
            .into_iter()
            .map(|(step, [fixed, moved])| {
                let place = |&v: &u32| places[v as usize] as usize;
                let value = |v: &u32| step.displacement[place(v)];
                let (drive_mm, direction) = (step.drive_mm, self.specimen.drive_direction());
                let per_mm = |plane: PlanePolynomial, along: f64| {
                    VectorField::new(move |x| {
                        let u = plane.at(x);
                        [0, 1, 2].map(|i| u[i] / drive_mm - along * direction[i])
                    })
                };
                ObservedStep {
                    displacement: part.mask.voxels.iter().map(value).collect(),
                    relative_noise: step
                        .relative_noise
                        .as_ref()
                        .map(|all| part.mask.voxels.iter().map(|v| all[place(v)]).collect()),
                    faces_per_mm: [Some(per_mm(fixed, 0.0)), Some(per_mm(moved, 1.0))],
                    ..step.clone()
                }
            })
            .collect();
        Ok(part)
    }

    /// The recording as it is compared with a model whose boundary is moved by `boundary`.
    ///
    /// # Errors
    /// As [`Self::between_measured_planes`].
    pub fn with_boundary(self, boundary: Boundary) -> Result<Observed, CalibrationError> {
        match boundary {
            Boundary::Commanded => Ok(self),
            Boundary::Measured => self.between_measured_planes(CUT_PART),
        }
    }

    /// One recording per step where each step has a boundary of its own, else this one alone.
    pub fn steps_apart(self) -> Vec<Observed> {
        if !self.has_measured_faces() {
            return vec![self];
        }
        self.steps.iter().map(|step| self.with_steps(vec![step.clone()])).collect()
    }

    /// Whether what was measured is imposed at the boundary.
    pub fn has_measured_faces(&self) -> bool {
        self.steps.iter().any(|s| s.faces_per_mm.iter().any(Option::is_some))
    }

    /// The displacement measured on the plane at `at_mm` across `axis`.
    fn plane_displacement(
        &self,
        step: &ObservedStep,
        axis: usize,
        at_mm: f64,
    ) -> Result<PlanePolynomial, CalibrationError> {
        let half_mm = half_extents_mm(&self.specimen);
        let axes = [[1, 2], [0, 2], [0, 1]][axis];
        let basis = PlaneBasis { axes, half_mm: axes.map(|a| half_mm[a]) };
        let grid = &self.mask.grid;
        let width = REACH_VOXELS * grid.voxel_mm[axis];
        let num = num_terms(DEGREE) + num_terms(SLOPE_DEGREE);
        let (mut matrix, mut right) = (DMatrix::<f64>::zeros(num, num), DMatrix::<f64>::zeros(num, 3));
        let mut count = 0;
        for (&voxel, u) in self.mask.voxels.iter().zip(&step.displacement) {
            let x = grid.center_mm(voxel as usize);
            let across = x[axis] - at_mm;
            if across.abs() > width || !u.iter().all(|c| c.is_finite()) {
                continue;
            }
            count += 1;
            let mut row = basis.terms(x, DEGREE);
            row.extend(basis.terms(x, SLOPE_DEGREE).into_iter().map(|t| t * across));
            let row = DVector::from_vec(row);
            matrix.ger(1.0, &row, &row, 1.0);
            for c in 0..3 {
                right.column_mut(c).axpy(u[c], &row, 1.0);
            }
        }
        if count < FEWEST * num {
            return Err(CalibrationError::NoMeasuredBoundary { reason: "too few voxels lie beside the planes" });
        }
        for i in 0..num {
            matrix[(i, i)] *= 1.0 + RIDGE;
        }
        let unsolved = CalibrationError::NoMeasuredBoundary { reason: "the voxels beside the planes do not span them" };
        let solution = matrix.cholesky().ok_or(unsolved)?.solve(&right);
        let coefficients = (0..num_terms(DEGREE)).map(|n| [0, 1, 2].map(|c| solution[(n, c)])).collect();
        Ok(PlanePolynomial { basis, coefficients })
    }
}

/// The specimen between the planes.
fn cut_specimen(whole: &Specimen, axis: usize, plane_mm: f64) -> Result<Specimen, CalibrationError> {
    // What the planes did before the drive was measured with the rest.
    let mut cut = Specimen { precompression_mm: 0.0, ..whole.clone() };
    match axis {
        0 => cut.block.length_mm = 2.0 * plane_mm,
        _ => cut.block.thickness_mm = 2.0 * plane_mm,
    }
    // As far apart as the planes are, they move.
    cut.drive_mm.iter_mut().for_each(|d| *d *= 2.0 * plane_mm / (2.0 * half_extents_mm(whole)[axis]));
    let is_possible = cut.validate().is_ok();
    if is_possible { Ok(cut) } else { Err(CalibrationError::NoMeasuredBoundary { reason: "the planes cut a hole" }) }
}

/// Terms of a polynomial of two variables up to a degree.
fn num_terms(degree: usize) -> usize {
    (degree + 1) * (degree + 2) / 2
}

/// Products of Legendre polynomials of the two coordinates of a plane, in half extents of the block.
#[derive(Clone, Copy)]
struct PlaneBasis {
    axes: [usize; 2],
    half_mm: [f64; 2],
}

impl PlaneBasis {
    fn terms(&self, x: [f64; 3], degree: usize) -> Vec<f64> {
        let [a, b] = [0, 1].map(|k| legendre((x[self.axes[k]] / self.half_mm[k]).clamp(-1.0, 1.0), degree));
        let mut terms = Vec::with_capacity(num_terms(degree));
        for i in 0..=degree {
            for j in 0..=degree - i {
                terms.push(a[i] * b[j]);
            }
        }
        terms
    }
}

/// Legendre polynomials up to a degree at t.
fn legendre(t: f64, degree: usize) -> Vec<f64> {
    let mut p = vec![1.0, t];
    for n in 1..degree {
        let n_ = n as f64;
        p.push(((2.0 * n_ + 1.0) * t * p[n] - n_ * p[n - 1]) / (n_ + 1.0));
    }
    p
}

/// A displacement over a plane, mm.
struct PlanePolynomial {
    basis: PlaneBasis,
    coefficients: Vec<[f64; 3]>,
}

impl PlanePolynomial {
    fn at(&self, x: [f64; 3]) -> [f64; 3] {
        let terms = self.basis.terms(x, DEGREE);
        let mut u = [0.0; 3];
        for (t, c) in terms.iter().zip(&self.coefficients) {
            for i in 0..3 {
                u[i] += t * c[i];
            }
        }
        u
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_problem::{same_mesh, truth};
    use super::*;
    use crate::calibration::test_problem::block;

    /// The planes' displacement is that of the model which made the recording, and the part between them sees the same
    /// voxels.
    #[test]
    fn planes_move_as_was_measured() {
        let specimen = block();
        let (_, synthetic) = same_mesh(&truth());
        let recording = synthetic.recording("planes", &specimen, synthetic.noiseless(), Filter::None).unwrap();
        let observed = Observed::new(&recording, 0.01).unwrap();
        let part = observed.between_measured_planes(CUT_PART).unwrap();
        assert!(part.mask.num_voxels() < observed.mask.num_voxels() && part.mask.num_voxels() > 50);
        let plane_mm = 0.5 * part.specimen.block.thickness_mm;
        for step in &part.steps {
            let [fixed, moved] = step.faces_per_mm.clone().map(Option::unwrap);
            // In the middle of the block the shear is simple: u_x = drive (y / thickness + 1/2).
            let x = |side: f64| [0.0, side * plane_mm, 0.0];
            let share = 0.5 * part.specimen.block.thickness_mm / (0.5 * specimen.block.thickness_mm);
            let expected = [0.5 * (1.0 - share), 0.5 * (1.0 + share)];
            let found = [fixed.at(x(-1.0))[0], moved.at(x(1.0))[0] + 1.0];
            for (found, expected) in found.iter().zip(expected) {
                // The free ends let the middle's shear differ by some percent.
                assert!((found - expected).abs() < 0.03, "{found} {expected}");
            }
        }
    }
}
