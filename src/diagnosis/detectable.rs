//! What would be found: how small each error of a planned experiment may be and still be named.
//!
//! A diagnosis names a cause whose fit lowers the deviance by the evidence that is called for and ln n for each of its
//! p parameters, and whose effect is more than a mesh's error. To first order both follow from the changes of the
//! prediction alone, before anything is recorded. Let d be the change of the prediction with one parameter (the cause's
//! others as drawn), N those with the material's parameters, of which ln κ is known to Λ beforehand, and C the
//! covariance of noise and allowance. What the material cannot do in the parameter's place is
//!
//!   e = d − N a,   a = (Nᵀ C⁻¹ N + Λ)⁻¹ Nᵀ C⁻¹ d.
//!
//! An error of size s leaves s e in the nominal model's fit, and the cause's fit, in which all of its parameters are
//! free, lowers the deviance by T ~ χ²_p(λ) with λ = s² dᵀ C⁻¹ e. The size sought is the smallest that keeps all of
//! these:
//!
//! * *evidence*: T > 30 + p ln n with 90 % probability ([`noncentrality_to_exceed`]);
//! * *allowance*: s e is large enough in displacement or force to be more than a mesh's
//!   ([`times_to_large_of`]), and so is what the nominal fit leaves by its means over boxes. Below that, the
//!   diagnosis looks for causes of the image alone, with ten times the evidence;
//! * *rivals*: no other cause that is tested explains so much of s e, for fewer parameters, that it would be named in
//!   this one's place. Where another explains the part ρ of λ, the difference of the two gains is near Gaussian, with
//!   the variance 4 λ (1 − ρ) from λ and 2 (p + p′ − 2 c) from what both fit to the noise, of which they have c in
//!   common.
//!
//! What is left out: causes with a place, which are searched for (debonds, inclusions, fibres, cuts), the set-up as a
//! whole and further Ogden terms may be rivals, too; that effects do not grow in proportion to their size; and what a
//! sample's mesh gets wrong beyond the allowance.

use super::cause::{Cause, CauseName};
use super::diagnose::BELIEVED_LOG_SD;
use super::error::DiagnosisError;
use super::evidence::{
    ALLOWANCE_OF_DRIVE, EVIDENCE, OF_IMAGE_ALONE, counted_part, penalty, times_to_large_force, times_to_large_of,
};
use super::laboratory::Laboratory;
use super::leftover::structure_of;
use super::load_curve::largest_drive_mm;
use super::metric::Metric;
use super::noncentral::noncentrality_to_exceed;
use super::options::DiagnosisOptions;
use super::planned::PlannedScan;
use super::registry::Registry;
use super::scene::Scene;
use super::score::{Prepared, ScoreTest};
use super::score_round::{Place, directions_of, suspects_of};
use super::trace::Trace;
use crate::calibration::{Boundary, Observed};
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::sensitivity::{DetectableSize, DetectionLimit};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Probability with which a cause of the size stated is named.
pub const DETECTION_PROBABILITY: f64 = 0.9;
/// The quantile of the normal distribution at that probability.
const NORMAL_QUANTILE: f64 = 1.281_551_565_5;
/// A part of a cause's own effect that others leave below this is rounding.
const ROUNDING: f64 = 1e-9;

/// The smallest size of one parameter of a cause that would be named.
#[derive(Clone, Debug)]
pub struct Detectable {
    /// The cause.
    pub cause: CauseName,
    /// Which one of its name, such as the number of a hole ([`Cause::variant`]).
    pub variant: [i64; 3],
    /// The cause in words.
    pub description: String,
    /// Number of the parameter among the cause's.
    pub place: usize,
    /// Its name, with its unit.
    pub parameter: String,
    /// Its size in that unit; infinite where it would be named at no size.
    pub size: f64,
    /// The largest size that it may have.
    pub largest: f64,
    /// What keeps a smaller one from being named.
    pub limited_by: DetectionLimit,
    /// The cause that would be named in its place where it is smaller; `None` unless that is what limits it.
    pub rival: Option<CauseName>,
}

impl Detectable {
    /// As results state it.
    pub fn row(&self) -> DetectableSize {
        DetectableSize {
            cause: self.cause.as_str().into(),
            description: self.description.clone(),
            parameter: self.parameter.clone(),
            size: (self.size <= self.largest).then_some(self.size),
            largest: self.largest,
            limited_by: self.limited_by,
            rival: self.rival.map(|name| name.as_str().into()),
        }
    }
}

/// How small the causes for which every recording is tested may be in `planned` and still be named with 90 %
/// probability by a diagnosis with `options`, the sample being of `material`: one entry per parameter of each cause, in
/// the order of the registry. Solves one equilibrium per drive.
///
/// # Errors
/// [`DiagnosisError`]: a setting is out of its range, the specimen cannot be modelled or has no equilibrium, or the
/// work was cancelled.
pub fn detectable(
    planned: &PlannedScan,
    material: &Material,
    options: &DiagnosisOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<Detectable>, DiagnosisError> {
    options.check()?;
    let registry = Registry::standard().without(&options.left_out)?;
    let registry = if options.boundary == Boundary::Measured { registry.without_boundary() } else { registry };
    let observed = planned.observed()?;
    let mut laboratory = Laboratory::new(&observed, &MeshOptions::scaled(&observed.specimen, options.mesh_factor))?;
    let prediction = laboratory.predict(material, &Scene::default(), is_cancelled)?;
    let suspects = suspects_of(&registry, &observed, &[], false);
    let place = Place { material, causes: &[], prediction: &prediction };
    let (nuisance, directions) = directions_of(&mut laboratory, place, &suspects)?;
    let allowance_mm = options.allowance_mm.unwrap_or(ALLOWANCE_OF_DRIVE * largest_drive_mm(&observed));
    let metric = Metric::new(&observed, allowance_mm, &|_| true).with_time_shares(planned.time_shares);
    let mut priors = vec![0.0; nuisance.len()];
    priors[0] = BELIEVED_LOG_SD.powi(-2);
    let firsts: Vec<usize> = directions
        .iter()
        .scan(0, |next, own| {
            let first = *next;
            *next += own.len();
            Some(first)
        })
        .collect();
    let directions = directions.concat();
    let prepared = ScoreTest::new(&metric, &nuisance[0].scaled(0.0), &nuisance, &priors).prepare(&directions);
    let room = Room { observed: &observed, metric: &metric, allowance_mm, suspects, firsts, prepared };
    let mut found = Vec::new();
    for (index, cause) in room.suspects.iter().enumerate() {
        for place in 0..cause.parameters().len() {
            let direction = room.firsts[index] + place;
            let own = own_effect(&directions[direction], &nuisance, &room.prepared.projected, direction);
            found.push(room.size_of(index, place, &own));
        }
    }
    let is_tested = |cause: &Arc<dyn Cause>| room.suspects.iter().any(|s| s.identity() == cause.identity());
    let untested = registry.tested(&observed.specimen).into_iter().filter(|c| !is_tested(c));
    found.extend(untested.flat_map(|cause| {
        let entry = |place| entry_of(&*cause, place, f64::INFINITY, DetectionLimit::Drives, None);
        (0..cause.parameters().len()).map(entry).collect::<Vec<_>>()
    }));
    Ok(found)
}

/// What the nuisance leaves of a direction.
fn own_effect(direction: &Trace, nuisance: &[Trace], projected: &DMatrix<f64>, column: usize) -> Trace {
    let following = nuisance.iter().enumerate();
    following.fold(direction.clone(), |left, (row, n)| left.plus(-projected[(row, column)], n))
}

fn entry_of(
    cause: &dyn Cause,
    place: usize,
    size: f64,
    limited_by: DetectionLimit,
    rival: Option<CauseName>,
) -> Detectable {
    let parameter = cause.parameters().swap_remove(place);
    Detectable {
        cause: cause.name(),
        variant: cause.variant(),
        description: cause.description(),
        place,
        largest: parameter.range[0].abs().max(parameter.range[1].abs()),
        parameter: parameter.name,
        size,
        limited_by,
        rival,
    }
}

/// The suspects of a planned scan and what the material leaves of their effects.
struct Room<'a> {
    observed: &'a Observed,
    metric: &'a Metric,
    allowance_mm: f64,
    suspects: Vec<Arc<dyn Cause>>,
    /// Per suspect the number of its first direction.
    firsts: Vec<usize>,
    prepared: Prepared,
}

impl Room<'_> {
    /// The size of a suspect's parameter whose own effect, per scale, is `own`.
    fn size_of(&self, index: usize, place: usize, own: &Trace) -> Detectable {
        let cause = &*self.suspects[index];
        let parameters = cause.parameters();
        let information = self.prepared.gram[(self.firsts[index] + place, self.firsts[index] + place)].max(0.0);
        let evident = |evidence: f64| {
            let value = evidence + penalty(self.metric, parameters.len());
            (noncentrality_to_exceed(value, parameters.len() as f64, DETECTION_PROBABILITY) / information).sqrt()
        };
        let large = times_to_large_of(cause, self.observed, own, self.allowance_mm);
        // What the nominal fit leaves must be seen before causes are looked for.
        let in_boxes = self.allowance_mm / structure_of(self.observed, own, self.metric);
        let looked_for = in_boxes.min(times_to_large_force(self.observed, own));
        let is_of_image_alone = !(cause.changes_sample() || cause.is_sponge());
        let usual = (evident(EVIDENCE), large.max(looked_for));
        let below = (evident(OF_IMAGE_ALONE * EVIDENCE), large);
        let of = |limits: (f64, f64)| limits.0.max(limits.1);
        let limits = if is_of_image_alone && of(below) < of(usual) { below } else { usual };
        let (rivalled, rival) = self.rivalled(index, place, information);
        let largest = of(limits).max(rivalled);
        let (limited_by, rival) = match largest {
            size if size <= limits.0 => (DetectionLimit::Noise, None),
            size if size <= limits.1 => (DetectionLimit::Allowance, None),
            _ => (DetectionLimit::Rival, rival),
        };
        entry_of(cause, place, largest * parameters[place].scale, limited_by, rival)
    }

    /// The multiple of a parameter's scale up to which another cause would be named in its place, and that cause.
    fn rivalled(&self, index: usize, place: usize, information: f64) -> (f64, Option<CauseName>) {
        let name = self.suspects[index].name();
        let mut worst = (0.0, None);
        for (other, rival) in self.suspects.iter().enumerate().filter(|(_, s)| s.name() != name) {
            let (own, theirs) = (self.directions_of(index), self.directions_of(other));
            let alike = Alike {
                share: (self.prepared.explained_of(&theirs, own[place]) / information).clamp(0.0, 1.0),
                overlap: self.prepared.overlap(&own, &theirs),
            };
            let root = root_noncentrality(self.contender(index), self.contender(other), alike);
            let size = root / information.sqrt();
            if size > worst.0 {
                worst = (size, Some(rival.name()));
            }
        }
        worst
    }

    /// How a suspect stands in a round.
    fn contender(&self, index: usize) -> Contender {
        let cause = &self.suspects[index];
        let num_parameters = cause.parameters().len();
        Contender {
            weight: counted_part(&**cause),
            num_parameters: num_parameters as f64,
            cost: penalty(self.metric, num_parameters),
        }
    }

    /// The numbers of a suspect's directions.
    fn directions_of(&self, suspect: usize) -> Vec<usize> {
        (0..self.suspects[suspect].parameters().len()).map(|n| self.firsts[suspect] + n).collect()
    }
}

/// A cause as it stands against others in a round.
#[derive(Clone, Copy)]
struct Contender {
    /// The part of its gain that counts.
    weight: f64,
    /// Its parameters.
    num_parameters: f64,
    /// What they cost.
    cost: f64,
}

/// How much two causes are alike.
#[derive(Clone, Copy)]
struct Alike {
    /// ρ: the part of what the one does that the other explains.
    share: f64,
    /// What their parameters have in common: as much of what both fit to the noise is the same ([`Prepared::overlap`]).
    overlap: f64,
}

/// √λ from which on `own` gains more than `rival` with the detection's probability: λ + p − cost of the one, times its
/// weight, against ρ λ + p′ − cost of the other.
fn root_noncentrality(own: Contender, rival: Contender, Alike { share, overlap }: Alike) -> f64 {
    let ahead = own.weight - rival.weight * share;
    let behind = own.weight * (own.cost - own.num_parameters) - rival.weight * (rival.cost - rival.num_parameters);
    let (a, b) = (own.weight, rival.weight);
    let slope = (a * a - 2.0 * a * b * share + b * b * share).max(0.0);
    let of_noise = a * a * own.num_parameters + b * b * rival.num_parameters - 2.0 * a * b * overlap;
    let constant = 2.0 * of_noise.max(0.0);
    // ahead λ − behind ≥ z √(4 slope λ + constant); with √(x + y) ≤ √x + √y a quadratic in √λ.
    let (half, rest) = (NORMAL_QUANTILE * slope.sqrt(), behind + NORMAL_QUANTILE * constant.sqrt());
    if ahead < ROUNDING {
        return if slope < ROUNDING && rest < 0.0 { 0.0 } else { f64::INFINITY };
    }
    let discriminant = half * half + ahead * rest;
    // Where it costs so much less that the other is behind at any size, there is nothing to ask.
    if discriminant < 0.0 { 0.0 } else { ((half + discriminant.sqrt()) / ahead).max(0.0) }
}

#[cfg(test)]
#[path = "detectable_tests.rs"]
mod tests;
