//! Taking out of a fit what it does not need.
//!
//! Near its end a fit's deviance is a quadratic form in its parameters. Of that form it is known at once what it costs
//! to do without a cause (Wald's statistic with all others free to follow), and where the others go. Causes are taken
//! out one after the other, the one that is missed least first (backward elimination), as long as none of them is
//! missed by more than it costs; then what is left is fitted again. Beside the set-up, whose models idealise, any other
//! cause must explain the part that rounds call for, too. A cause that changes the sample must also do more
//! than a mesh's error could: where hardly anything would be left without it, it goes, whatever the evidence. One that
//! changes the image alone, and by no more than that, needs far more evidence than usual.

use super::cause_fit::CauseFit;
use super::error::DiagnosisError;
use super::evidence::{EVIDENCE, OF_IMAGE_ALONE, UNEXPLAINED, penalty, smallest_share};
use super::fit::{derivatives, normal_matrix, prior_scales};
use super::found::FoundCause;
use super::inference::Inference;
use super::supposed::Supposed;
use super::trace::Trace;
use nalgebra::{DMatrix, DVector};

/// What a cause must do to stay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Needed {
    /// Be called for by the evidence: for causes of which each was found to be more than a mesh's error.
    ByEvidence,
    /// Do more than a mesh's error could besides: for parts that were put in together, unasked.
    BeyondAMesh,
}

/// The quadratic form of a fit at its end, in scaled parameters.
struct QuadraticModel {
    /// Half the Hessian of the deviance.
    matrix: DMatrix<f64>,
    /// How far each parameter is from where it would be without its cause; zero for the material's, which have no such
    /// place.
    away: DVector<f64>,
    /// Per parameter: the cause that it belongs to, `None` for the material's.
    owners: Vec<Option<usize>>,
    /// Changes of the prediction with each parameter.
    columns: Vec<Trace>,
}

impl QuadraticModel {
    fn of(inference: &mut Inference, fitted: &CauseFit) -> Result<QuadraticModel, DiagnosisError> {
        let Inference { laboratory, metric, settings, .. } = inference;
        let columns = derivatives(laboratory, &fitted.material, &fitted.causes, &fitted.prediction)?;
        let weighed = metric.weigh_all(&columns);
        let matrix = normal_matrix(metric, &weighed, &fitted.material, &fitted.causes, settings);
        let num_material = fitted.material.parameters().len();
        let (mut away, mut owners) = (vec![0.0; num_material], vec![None; num_material]);
        for (index, supposed) in fitted.causes.iter().enumerate() {
            let parameters = supposed.cause.parameters();
            for ((value, start), p) in supposed.values.iter().zip(supposed.cause.start()).zip(&parameters) {
                away.push((value - start) / p.scale);
                owners.push(Some(index));
            }
        }
        Ok(QuadraticModel { matrix, away: DVector::from_vec(away), owners, columns })
    }

    fn places_of(&self, cause: usize) -> Vec<usize> {
        (0..self.owners.len()).filter(|i| self.owners[*i] == Some(cause)).collect()
    }

    /// The part of the matrix that belongs to a cause once all others have followed (its Schur complement); `None`
    /// where the others are not known.
    fn own(&self, cause: usize) -> Option<DMatrix<f64>> {
        self.schur_complement(&self.places_of(cause))
    }

    /// The matrix at `places` once all other parameters have followed; `None` where these are not known.
    fn schur_complement(&self, places: &[usize]) -> Option<DMatrix<f64>> {
        let rest: Vec<usize> = (0..self.owners.len()).filter(|i| !places.contains(i)).collect();
        let part = |rows: &[usize], columns: &[usize]| {
            DMatrix::from_fn(rows.len(), columns.len(), |i, j| self.matrix[(rows[i], columns[j])])
        };
        let cross = part(&rest, places);
        let followed = part(&rest, &rest).cholesky()?.solve(&cross);
        Some(part(places, places) - cross.tr_mul(&followed))
    }

    /// By how much the deviance rises without a cause, all others free to follow; infinite where it is not known.
    fn missed(&self, cause: usize) -> f64 {
        let places = self.places_of(cause);
        let away = DVector::from_fn(places.len(), |i, _| self.away[places[i]]);
        self.own(cause).map_or(f64::INFINITY, |own| away.dot(&(own * &away)))
    }

    /// By how much the deviance rises without any cause, the material free to follow: what all of them explain.
    fn explained(&self) -> f64 {
        let places: Vec<usize> = (0..self.owners.len()).filter(|i| self.owners[*i].is_some()).collect();
        let away = DVector::from_fn(places.len(), |i, _| self.away[places[i]]);
        self.schur_complement(&places).map_or(0.0, |own| away.dot(&(own * &away)))
    }

    /// What the parameters of a cause cost: of one that is believed in the logarithm of how far the data narrow the
    /// belief (the Occam factor of Laplace's approximation), of any other ln n. What is no part of the set-up must be
    /// called for by as much evidence as any cause.
    fn cost(&self, cause: usize, supposed: &Supposed, inference: &Inference) -> f64 {
        let parameters = supposed.cause.parameters();
        if parameters.iter().any(|p| p.believed_sd.is_none()) {
            return penalty(&inference.metric, parameters.len()).max(EVIDENCE);
        }
        let Some(own) = self.own(cause) else { return 0.0 };
        let prior: f64 = parameters.iter().map(|p| -2.0 * prior_scales(p).ln()).sum();
        let log_determinant =
            own.cholesky().map_or(0.0, |c| 2.0 * c.l().diagonal().iter().map(|x| x.ln()).sum::<f64>());
        let evidence = if supposed.cause.is_of_set_up() { 0.0 } else { EVIDENCE };
        (log_determinant - prior).max(0.0) + evidence
    }

    /// The model without a cause: the others have followed.
    fn without(self, cause: usize) -> QuadraticModel {
        let places = self.places_of(cause);
        let rest: Vec<usize> = (0..self.owners.len()).filter(|i| !places.contains(i)).collect();
        let matrix = DMatrix::from_fn(rest.len(), rest.len(), |i, j| self.matrix[(rest[i], rest[j])]);
        let followed = self.followed(&places, &rest);
        let away = DVector::from_fn(rest.len(), |i, _| {
            if self.owners[rest[i]].is_some() { self.away[rest[i]] + followed[i] } else { 0.0 }
        });
        let owners = rest.iter().map(|&i| self.owners[i]).collect();
        let columns = rest.iter().map(|&i| self.columns[i].clone()).collect();
        QuadraticModel { matrix, away, owners, columns }
    }

    /// Root mean square of what would be left of the displacement at the last drive without a cause, all others having
    /// followed, mm, to first order.
    fn left_without_mm(&self, cause: usize) -> f64 {
        let places = self.places_of(cause);
        let rest: Vec<usize> = (0..self.owners.len()).filter(|i| !places.contains(i)).collect();
        let zero = self.columns[0].scaled(0.0);
        let own = places.iter().fold(zero, |sum, &p| sum.plus(self.away[p], &self.columns[p]));
        let left =
            rest.iter().zip(&self.followed(&places, &rest)).fold(own, |sum, (&q, by)| sum.plus(-by, &self.columns[q]));
        Trace { displacement: left.displacement.last().cloned().into_iter().collect(), force: vec![] }.rms_mm()
    }

    /// How far the parameters at `rest` follow where those at `places` go back to where they would be without their
    /// cause.
    fn followed(&self, places: &[usize], rest: &[usize]) -> DVector<f64> {
        let matrix = DMatrix::from_fn(rest.len(), rest.len(), |i, j| self.matrix[(rest[i], rest[j])]);
        let pull = DVector::from_fn(rest.len(), |i, _| {
            places.iter().map(|&p| self.matrix[(rest[i], p)] * self.away[p]).sum::<f64>()
        });
        matrix.cholesky().map_or_else(|| DVector::zeros(rest.len()), |f| f.solve(&pull))
    }

    /// Root mean square of what a cause adds to the displacement, mm, to first order.
    fn effect_rms_mm(&self, cause: usize) -> f64 {
        let places = self.places_of(cause);
        let zero = self.columns[0].scaled(0.0);
        places.iter().fold(zero, |sum, &p| sum.plus(self.away[p], &self.columns[p])).rms_mm()
    }
}

/// Whether a cause may be taken out: an artefact was seen in the image.
fn may_go(supposed: &Supposed) -> bool {
    !supposed.cause.is_artefact()
}

/// The fit without the causes that it does not need.
///
/// # Errors
/// [`DiagnosisError`]: no derivatives, no equilibrium, or the work was cancelled.
pub(super) fn thinned(
    inference: &mut Inference,
    measured: &Trace,
    fitted: CauseFit,
    rule: Needed,
) -> Result<CauseFit, DiagnosisError> {
    let mut model = QuadraticModel::of(inference, &fitted)?;
    let mut left: Vec<usize> = (0..fitted.causes.len()).collect();
    let has_set_up = fitted.causes.iter().any(|s| s.cause.is_of_set_up());
    let least_beside_set_up = if has_set_up { smallest_share(&fitted.causes) * model.explained() } else { 0.0 };
    loop {
        let least = left
            .iter()
            .filter(|&&cause| may_go(&fitted.causes[cause]))
            .map(|&cause| {
                let supposed = &fitted.causes[cause];
                let least = if supposed.cause.is_of_set_up() { 0.0 } else { least_beside_set_up };
                let (missed, cost) = (model.missed(cause), model.cost(cause, supposed, inference).max(least));
                let (name, left_mm) = (supposed.cause.name(), model.left_without_mm(cause));
                (inference.progress)(&format!(
                    "without '{name}' {left_mm:.4} mm rms are left and the deviance rises by {missed:.0}; it costs {cost:.0}"
                ));
                // Of those that are called for by the data, what a mesh could do goes last: what it stands for may be
                // seen only once the others are out.
                let is_a_meshs = |mm: f64| mm < UNEXPLAINED * inference.allowance_mm;
                let needed = match supposed.cause.changes_sample() {
                    _ if rule == Needed::ByEvidence => 0.0,
                    true if is_a_meshs(left_mm) => f64::INFINITY,
                    false if is_a_meshs(model.effect_rms_mm(cause)) => OF_IMAGE_ALONE * EVIDENCE,
                    _ => 0.0,
                };
                let beyond = missed - cost;
                (cause, if beyond < needed { beyond.min(-f64::MIN_POSITIVE) } else { beyond })
            })
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((cause, _)) = least.filter(|(_, beyond)| *beyond < 0.0) else { break };
        model = model.without(cause);
        left.retain(|c| *c != cause);
    }
    if left.len() == fitted.causes.len() {
        return Ok(fitted);
    }
    let causes: Vec<Supposed> = left
        .iter()
        .map(|&index| {
            let Supposed { cause, values } = &fitted.causes[index];
            let away = model.places_of(index).into_iter().map(|p| model.away[p]);
            let moved = cause.parameters().into_iter().zip(cause.start()).zip(away).zip(values);
            let values = moved.map(|(((p, start), away), was)| {
                let value = (start + away * p.scale).clamp(p.range[0], p.range[1]);
                if value.is_finite() { value } else { *was }
            });
            Supposed { cause: cause.clone(), values: values.collect() }
        })
        .collect();
    (inference.progress)(&format!("fitting without {} parts that are not needed", fitted.causes.len() - left.len()));
    inference.fit(measured, &fitted.material, &causes)
}

/// All causes of a fit but artefacts, each with what is missed without it (less its
/// cost) and what it adds to the displacement.
///
/// # Errors
/// As [`thinned`].
pub(super) fn named_causes(inference: &mut Inference, fitted: &CauseFit) -> Result<Vec<FoundCause>, DiagnosisError> {
    let model = QuadraticModel::of(inference, fitted)?;
    let observed = inference.laboratory.observed();
    let found = |(index, supposed): (usize, &Supposed)| {
        let evidence = model.missed(index) - model.cost(index, supposed, inference);
        FoundCause::of_fit(fitted, index, observed).with_evidence(evidence, model.effect_rms_mm(index))
    };
    Ok(fitted.causes.iter().enumerate().filter(|(_, s)| !s.cause.is_artefact()).map(found).collect())
}
