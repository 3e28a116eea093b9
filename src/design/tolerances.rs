//! What a design loses where it is not made as drawn, and by how much its dimensions may therefore be off.

use super::confirm::Confirmed;
use super::dimension::{Dimension, DimensionKind};
use super::evaluator::Evaluated;
use super::fidelity::Fidelity;
use super::objective::Reference;
use super::rounding::{made_in_steps_of, multiple};
use super::search_error::SearchError;
use super::search_run::{Progress, SearchRun};
use super::state::State;
use super::words::{listed, short_number};
use crate::sensitivity::ScanSettings;
use crate::specimen::{HoleTolerances, Specimen, Tolerances};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicUsize, Ordering};
use utoipa::ToSchema;

/// What a dimension may cost of the objective.
const MAY_COST: f64 = 0.01;
/// Tolerances are at most so many steps of the mould maker: the objective was looked at one step off.
const MOST_STEPS: f64 = 2.0;
/// Tolerances are multiples of the first of these, or, where they are smaller, of the second, mm.
const MULTIPLES_MM: [f64; 2] = [0.05, 0.01];

/// What a design loses where one of its dimensions is off.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DimensionTolerance {
    /// Which dimension.
    pub dimension: Dimension,
    /// What it is called.
    pub name: String,
    /// What it is as drawn, mm.
    pub drawn_mm: f64,
    /// The step by which it was changed, mm.
    pub step_mm: f64,
    /// Relative change of the objective where it is smaller by the step; null where the specimen then cannot
    /// be solved.
    pub relative_change_smaller: Option<f64>,
    /// The same where it is larger.
    pub relative_change_larger: Option<f64>,
    /// By how much it may be off, ± mm, so that the objective falls by at most a hundredth for it alone; two steps at
    /// most. Null where a specimen one step off cannot be solved.
    pub tolerance_mm: Option<f64>,
}

impl SearchRun<'_> {
    /// What `design` loses where its dimensions are off, all else held: by the objective on the coarse mesh of the
    /// search, over that of `base`. Empty where that mesh has no equilibrium of either.
    ///
    /// # Errors
    /// [`SearchError`]: cancelled.
    pub(super) fn tolerances(
        &self,
        base: &Specimen,
        design: &Confirmed,
        state: &State,
    ) -> Result<Vec<DimensionTolerance>, SearchError> {
        let (study, specimen) = (self.study, &design.specimen);
        let scan = design.scan().unwrap_or(&study.scan);
        let stopped = || state.stopped(study, "tolerances");
        let evaluated = |scan: &ScanSettings, specimen: &Specimen| {
            self.estimated_in(scan, specimen, Fidelity::Coarse).ok_or_else(stopped)
        };
        let (Ok(of_base), Ok(as_drawn)) = (evaluated(&study.scan, base)?, evaluated(scan, specimen)?) else {
            return Ok(Vec::new());
        };
        let reference = Reference::new(study, self.evaluator.samples(), &of_base.responses);
        let log_objective = |found: &Evaluated| reference.objective(&reference.judge(found));
        let before = log_objective(&as_drawn);
        let step_mm = made_in_steps_of(&study.limits);
        let dimensions = Dimension::all_of(specimen);
        let changes: Vec<(usize, f64)> =
            (0..dimensions.len()).flat_map(|d| [-step_mm, step_mm].map(|by_mm| (d, by_mm))).collect();
        let (total, done) = (changes.len(), AtomicUsize::new(0));
        let (best, leader) = (Some(design.objective), Some(specimen.clone()));
        let of_change = |(d, by_mm): &(usize, f64)| -> Result<Option<f64>, SearchError> {
            let found = evaluated(scan, &dimensions[*d].changed(specimen, *by_mm))?;
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            (self.progress)(&Progress { stage: "tolerances", done, total, best, leader: leader.clone() });
            Ok(found.ok().map(|found| (log_objective(&found) - before).exp_m1()))
        };
        let found = changes.par_iter().map(of_change).collect::<Result<Vec<_>, _>>()?;
        let told = dimensions.into_iter().zip(found.chunks_exact(2));
        Ok(told
            .map(|(dimension, both)| DimensionTolerance {
                name: dimension.words(specimen),
                drawn_mm: dimension.drawn_mm(specimen),
                step_mm,
                relative_change_smaller: both[0],
                relative_change_larger: both[1],
                tolerance_mm: both[0].zip(both[1]).map(|(smaller, larger)| tolerance_mm(step_mm, smaller, larger)),
                dimension,
            })
            .collect())
    }
}

/// The largest deviation, ± mm, at which the parabola through what is known one step off falls by no more than
/// [`MAY_COST`] on either side, rounded down.
fn tolerance_mm(step_mm: f64, smaller: f64, larger: f64) -> f64 {
    // change(d) = ½ curvature d² − slope |d| on the worse side.
    let curvature = (smaller + larger) / (step_mm * step_mm);
    let slope = 0.5 * (larger - smaller).abs() / step_mm;
    let discriminant = slope * slope - 2.0 * curvature * MAY_COST;
    let most = MOST_STEPS * step_mm;
    // The smaller root, in the form that divides by no curvature.
    let root = if discriminant < 0.0 { most } else { 2.0 * MAY_COST / (slope + discriminant.sqrt()) };
    let within = root.min(most);
    let [coarse, fine] = MULTIPLES_MM;
    let unit = if within < coarse * (1.0 - 1e-9) { fine } else { coarse };
    multiple(unit, (within / unit + 1e-9).floor().max(1.0))
}

/// Tolerances of the drawing of every sample of `specimen`.
pub(super) fn on_drawings(tolerances: &[DimensionTolerance], specimen: &Specimen) -> Vec<Tolerances> {
    let of_sample = |(place, sample): (usize, &Specimen)| {
        let own: Vec<&DimensionTolerance> = tolerances.iter().filter(|t| t.dimension.sample == place).collect();
        let of = |kind: DimensionKind, hole: Option<usize>| {
            let is_it = |t: &&&DimensionTolerance| {
                t.dimension.kind == kind
                    && hole.map_or(t.dimension.holes.is_empty(), |h| t.dimension.holes.contains(&h))
            };
            own.iter().find(is_it).and_then(|t| t.tolerance_mm)
        };
        let of_hole = |number: usize| HoleTolerances {
            center_mm: [DimensionKind::X, DimensionKind::Other].map(|kind| of(kind, Some(number))),
            diameter_mm: of(DimensionKind::Diameter, Some(number)),
            length_mm: of(DimensionKind::HoleLength, Some(number)),
        };
        let num_holes = if own.is_empty() { 0 } else { sample.holes.len() };
        Tolerances {
            block_mm: [DimensionKind::Length, DimensionKind::Thickness, DimensionKind::Width]
                .map(|kind| of(kind, None)),
            holes: (1..=num_holes).map(of_hole).collect(),
        }
    };
    specimen.samples().iter().enumerate().map(of_sample).collect()
}

/// How exactly the design is to be made, in a sentence; empty where that is not known.
pub(super) fn in_words(tolerances: &[DimensionTolerance]) -> String {
    let names_of = |of: Option<f64>| -> Vec<String> {
        tolerances.iter().filter(|t| t.tolerance_mm == of).map(|t| t.name.clone()).collect()
    };
    let mut known: Vec<f64> = tolerances.iter().filter_map(|t| t.tolerance_mm).collect();
    known.sort_by(f64::total_cmp);
    known.dedup();
    let mut said = Vec::new();
    if !known.is_empty() {
        let each = known.iter().map(|t| format!("the {} to ±{} mm", listed(&names_of(Some(*t))), short_number(*t)));
        let cost = short_number(100.0 * MAY_COST);
        let most = if tolerances.len() > 1 { "Each of them alone" } else { "It" };
        said.push(format!(
            "Make {}. {most} then costs at most {cost} % of the objective.",
            each.collect::<Vec<_>>().join("; ")
        ));
    }
    let unstable = names_of(None);
    if let (false, Some(step_mm)) = (unstable.is_empty(), tolerances.first().map(|t| t.step_mm)) {
        said.push(format!(
            "The {} must be held better than to {} mm: so far off the specimen cannot be solved.",
            listed(&unstable),
            short_number(step_mm)
        ));
    }
    said.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half a per cent a step, both ways: a hundredth is lost two steps off. Four times as much: half a step.
    #[test]
    fn a_slope_is_followed() {
        assert_eq!(tolerance_mm(0.1, -0.005, 0.005), 0.2);
        assert_eq!(tolerance_mm(0.1, 0.02, -0.02), 0.05);
        assert_eq!(tolerance_mm(0.1, 0.05, -0.05), 0.02);
    }

    /// At an optimum the loss grows with the square: four per cent a step off, one per cent half a step off. Where
    /// nothing is lost the tolerance is what was looked at, twice.
    #[test]
    fn an_optimum_is_flat() {
        assert_eq!(tolerance_mm(0.1, -0.04, -0.04), 0.05);
        assert_eq!(tolerance_mm(0.1, -0.0001, -0.0001), 0.2);
        assert_eq!(tolerance_mm(0.1, 0.0, 0.0), 0.2);
        assert_eq!(tolerance_mm(0.5, 0.01, 0.01), 1.0);
    }

    fn tolerance(kind: DimensionKind, holes: &[usize], tolerance_mm: Option<f64>) -> DimensionTolerance {
        let dimension = Dimension { sample: 0, kind, holes: holes.to_vec() };
        let specimen = Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).expect("a specimen");
        DimensionTolerance {
            name: dimension.words(&specimen),
            drawn_mm: dimension.drawn_mm(&specimen),
            step_mm: 0.1,
            relative_change_smaller: None,
            relative_change_larger: None,
            tolerance_mm,
            dimension,
        }
    }

    #[test]
    fn alike_tolerances_are_said_together() {
        let all = [
            tolerance(DimensionKind::Length, &[], Some(0.2)),
            tolerance(DimensionKind::Thickness, &[], Some(0.05)),
            tolerance(DimensionKind::Diameter, &[1, 2], Some(0.2)),
            tolerance(DimensionKind::X, &[1, 2], None),
        ];
        assert_eq!(
            in_words(&all),
            "Make the thickness to ±0.05 mm; the length and ⌀ of holes 1 and 2 to ±0.2 mm. Each of them alone then costs at most 1 % \
             of the objective. The x of holes 1 and 2 must be held better than to 0.1 mm: so far off the specimen cannot be \
             solved."
        );
        assert_eq!(in_words(&[]), "");
    }

    /// Both holes of a mirrored pair get the tolerances that they share.
    #[test]
    fn drawings_have_them() {
        let specimen = Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).expect("a specimen");
        let all = [
            tolerance(DimensionKind::Thickness, &[], Some(0.05)),
            tolerance(DimensionKind::Diameter, &[1, 2], Some(0.2)),
            tolerance(DimensionKind::X, &[1, 2], None),
        ];
        let drawings = on_drawings(&all, &specimen);
        let hole = HoleTolerances { diameter_mm: Some(0.2), ..HoleTolerances::default() };
        assert_eq!(drawings, [Tolerances { block_mm: [None, Some(0.05), None], holes: vec![hole; 2] }]);
        assert_eq!(on_drawings(&[], &specimen), [Tolerances::default()]);
    }
}
