//! What a material predicts of recordings over two parameters, as polynomials of degree five in both together.
//!
//! The model is solved at nine places, three by three, with its derivatives: 27 numbers of each voxel's displacement
//! and of each force for the 21 coefficients of a polynomial, which is fitted by least squares. It is determined: on a
//! line through three of the places a polynomial of degree five that vanishes at them with its slopes is zero
//! (Hermite). A loss is the square of a sum of the 27 with known weights, so that their products tell it at every
//! place.

use super::observed::Observed;
use super::prediction::Prediction;
use nalgebra::{DMatrix, DVector};

/// Degree of the polynomials.
const DEGREE: i32 = 5;
/// The roots of the losses by the polynomials (misfits as parts of what is measured) may differ from those solved at
/// the nine places by this part of the largest.
const FOLLOWED: f64 = 1e-3;
/// Singular values below this part of the largest are rounding.
const ROUNDING: f64 = 1e-12;

/// One of the numbers of which the polynomials are made.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Datum {
    /// The place: parts of the reach of each parameter, from −1 to 1.
    parts: [f64; 2],
    /// Which parameter it is a derivative by; none for the value.
    by: Option<usize>,
}

impl Datum {
    /// What it is of every monomial xⁱyʲ.
    fn of_monomials(self) -> DVector<f64> {
        let along = |a: usize, n: i32| {
            let x = self.parts[a];
            match self.by {
                Some(by) if by == a => f64::from(n) * if n > 0 { x.powi(n - 1) } else { 0.0 },
                _ => x.powi(n),
            }
        };
        let monomials = (0..=DEGREE).flat_map(|i| (0..=DEGREE - i).map(move |j| [i, j]));
        DVector::from_iterator(
            ((DEGREE + 1) * (DEGREE + 2) / 2) as usize,
            monomials.map(|[i, j]| along(0, i) * along(1, j)),
        )
    }
}

/// One drive of a recording.
struct Drive {
    /// Which recording and step.
    place: (usize, usize),
    /// Voxels that were measured.
    used: Vec<usize>,
    /// Their number times the square of their largest displacement, mm².
    scale_mm2: f64,
    measured_n: Option<f64>,
    /// Measured minus the estimate's; then by how much every datum is less than the estimate's, mm.
    displacements: Vec<DVector<f64>>,
    /// The same of the force over the measured one; nothing where there is none.
    forces: Vec<f64>,
}

/// What was solved at the places.
pub(super) struct Patch<'a> {
    estimate: &'a [Prediction],
    data: Vec<Datum>,
    drives: Vec<Drive>,
}

impl<'a> Patch<'a> {
    /// Of `observed`, around what the estimate predicts of them.
    pub(super) fn new(observed: &[Observed], estimate: &'a [Prediction]) -> Patch<'a> {
        let mut drives = Vec::new();
        for (r, (recording, prediction)) in observed.iter().zip(estimate).enumerate() {
            for (d, (step, predicted)) in recording.steps.iter().zip(&prediction.displacements).enumerate() {
                let is_used = |v: &usize| step.displacement[*v].iter().all(|x| x.is_finite());
                let used: Vec<usize> = (0..step.displacement.len()).filter(is_used).collect();
                let squares = used.iter().map(|&v| step.displacement[v].iter().map(|x| x * x).sum::<f64>());
                let measured_n = step.force.map(|f| f.value_n);
                drives.push(Drive {
                    place: (r, d),
                    scale_mm2: used.len() as f64 * squares.fold(0.0, f64::max),
                    measured_n,
                    displacements: vec![difference(&used, &step.displacement, predicted)],
                    forces: measured_n.map(|f| 1.0 - prediction.forces_n[d] / f).into_iter().collect(),
                    used,
                });
            }
        }
        Patch { estimate, data: Vec::new(), drives }
    }

    /// Adds what is predicted at a place; `slopes` are the two parameters' places in the material and how their values
    /// change with the parts.
    pub(super) fn add(&mut self, parts: [f64; 2], predictions: &[Prediction], slopes: [(usize, f64); 2]) {
        self.data.extend([None, Some(0), Some(1)].map(|by| Datum { parts, by }));
        for drive in &mut self.drives {
            let (r, d) = drive.place;
            let (prediction, estimate) = (&predictions[r], &self.estimate[r]);
            let value = difference(&drive.used, &estimate.displacements[d], &prediction.displacements[d]);
            drive.displacements.push(value);
            for (index, slope) in slopes {
                let field = &prediction.sensitivities[d][index];
                let rows = drive.used.iter().flat_map(|&v| field[v]).map(|x| -slope * x);
                drive.displacements.push(DVector::from_iterator(3 * drive.used.len(), rows));
            }
            if let Some(measured) = drive.measured_n {
                drive.forces.push((estimate.forces_n[d] - prediction.forces_n[d]) / measured);
                let of_slopes = slopes.map(|(i, slope)| -slope * prediction.force_sensitivities[d][i] / measured);
                drive.forces.extend(of_slopes);
            }
        }
    }

    /// The losses between the places; none where polynomials do not follow what was solved.
    pub(super) fn losses(&self) -> Option<Losses> {
        let rows: Vec<_> = self.data.iter().map(|datum| datum.of_monomials().transpose()).collect();
        let losses = Losses {
            coefficients: DMatrix::from_rows(&rows).pseudo_inverse(ROUNDING).ok()?,
            drives: self.drives.iter().map(Drive::products).collect(),
        };
        let values = self.data.iter().enumerate().filter(|(_, datum)| datum.by.is_none());
        let solved: Vec<([f64; 2], [f64; 2])> = values
            .map(|(n, datum)| {
                let mut alone = DVector::zeros(self.data.len());
                alone[n] = 1.0;
                (losses.at(datum.parts), losses.of_weights(&alone))
            })
            .collect();
        let largest = [0, 1].map(|k| solved.iter().map(|(_, solved)| solved[k].sqrt()).fold(0.0, f64::max));
        let is_near =
            |k: usize, found: f64, solved: f64| (found.max(0.0).sqrt() - solved.sqrt()).abs() <= FOLLOWED * largest[k];
        let is_followed = solved.iter().all(|(found, solved)| (0..2).all(|k| is_near(k, found[k], solved[k])));
        is_followed.then_some(losses)
    }
}

/// The losses over the two parameters.
pub(super) struct Losses {
    /// Of the monomials by the data.
    coefficients: DMatrix<f64>,
    drives: Vec<Products>,
}

/// One drive's part of the losses.
struct Products {
    /// Products of all columns of displacements over the scale.
    displacements: DMatrix<f64>,
    /// Of the force; nothing where there is none.
    forces: Vec<f64>,
}

impl Losses {
    /// ℓ_u and ℓ_F at a place.
    pub(super) fn at(&self, parts: [f64; 2]) -> [f64; 2] {
        // Those of the values add up to one, since polynomials hold what is constant.
        self.of_weights(&self.coefficients.tr_mul(&Datum { parts, by: None }.of_monomials()))
    }

    /// The losses of a sum of the data.
    fn of_weights(&self, weights: &DVector<f64>) -> [f64; 2] {
        let weights = weights.clone().insert_row(0, 1.0);
        let (mut loss_u, mut loss_f, mut num_forces) = (0.0, 0.0, 0.0);
        for Products { displacements, forces } in &self.drives {
            loss_u += weights.dot(&(displacements * &weights));
            if !forces.is_empty() {
                loss_f += weights.iter().zip(forces).map(|(w, f)| w * f).sum::<f64>().powi(2);
                num_forces += 1.0;
            }
        }
        [loss_u / self.drives.len() as f64, if num_forces > 0.0 { loss_f / num_forces } else { 0.0 }]
    }
}

impl Drive {
    fn products(&self) -> Products {
        let columns = DMatrix::from_columns(&self.displacements);
        Products { displacements: columns.tr_mul(&columns) / self.scale_mm2, forces: self.forces.clone() }
    }
}

/// `from` minus `other` in the voxels that are used, the components of a voxel one after the other, mm.
fn difference(used: &[usize], from: &[[f64; 3]], other: &[[f64; 3]]) -> DVector<f64> {
    let rows = used.iter().flat_map(|&v| (0..3).map(move |c| from[v][c] - other[v][c]));
    DVector::from_iterator(3 * used.len(), rows)
}
