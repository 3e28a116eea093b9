//! A stiff or soft place inside the sample.

use super::cut::Slit;
use crate::diagnosis::balls::{Ball, change_of_ball, log_factor_of_ball};
use crate::diagnosis::candidate::Candidate;
use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::error::DiagnosisError;
use crate::diagnosis::evidence::{EVIDENCE, WORTH_A_FIT};
use crate::diagnosis::location::Location;
use crate::diagnosis::scene::Scene;
use crate::diagnosis::search::Search;
use crate::diagnosis::supposed::{Supposed, scene_of};
use crate::fem::Field;
use crate::specimen::Specimen;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("inclusion");
/// What a laboratory can do about it.
const REMEDY: &str = "Degas the mixture and look at the magnitude image for bubbles and lumps before the test.";
/// Its line in the registry.
pub(super) const ENTRY: Entry = Entry { name: NAME, remedy: REMEDY, origin: Origin::Searched(suspects) };

/// Width of the inclusion's edge, mm. With a wider edge a fit makes the stiffness factor f of stiff balls too large and
/// their radius too small: with twice the width, ln f is off by a tenth. The points in an element at which the field is
/// taken are some three times this width apart.
const EDGE_MM: f64 = 0.25;

/// Below this ln of the factor a soft place may be none: a cut lets go as much.
const HOLLOW: f64 = -1.8;

/// A ball whose stiffness is the surroundings' times a factor.
pub struct Inclusion {
    /// Where the search for it starts: centre, mm.
    pub center_mm: [f64; 3],
    /// Radius at the start, mm.
    pub radius_mm: f64,
    /// ln of the factor at the start.
    pub log_factor: f64,
    /// Half extents of the block, mm.
    pub half_mm: [f64; 3],
}

/// The inclusions worth a full fit, of the balls that explain much to first order.
///
/// Where an inclusion may be the leading cause, every ball is tried with its full stiffness, which first order tells
/// badly. The best stiff and the best soft one are then taken, because a stiff one above the middle and a soft one
/// below look alike.
fn suspects(search: &mut Search) -> Result<Vec<Candidate>, DiagnosisError> {
    let mut balls = match search.stiffness_map()? {
        Some(map) => map.balls.clone(),
        None => return Ok(Vec::new()),
    };
    // Where a ball is in the fit already, a second one would mend the shape of the first.
    let known: Vec<&Supposed> = search.current.causes.iter().filter(|s| s.cause.name() == NAME).collect();
    balls.retain(|ball| {
        known.iter().all(|s| {
            let away = (0..3).map(|a| (s.values[1 + a] - ball.center_mm[a]).powi(2)).sum::<f64>().sqrt();
            away > s.values[4] + ball.radius_mm
        })
    });
    let best = balls.first().map_or(0.0, |b| b.explained);
    let is_worth = best > EVIDENCE && best > WORTH_A_FIT * search.top;
    let mut starts: Vec<(f64, Candidate)> = Vec::new();
    for ball in balls.into_iter().take(if is_worth { usize::MAX } else { 1 }) {
        let start = if is_worth { with_full_stiffness(search, &ball)? } else { Some(first_order(&ball)) };
        starts.extend(start);
    }
    starts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let first = |is_stiff: bool| starts.iter().position(|(_, c)| (c.values[0] > 0.0) == is_stiff);
    let mut chosen: Vec<usize> = [first(true), first(false)].into_iter().flatten().collect();
    chosen.sort_unstable();
    Ok(chosen.into_iter().map(|n| Candidate { score: best, ..starts[n].1.clone() }).collect())
}

/// A ball as first order tells it, with what it explains.
fn first_order(ball: &Ball) -> (f64, Candidate) {
    let cause = Inclusion::of(ball);
    (ball.explained, Candidate { values: cause.start(), cause: Arc::new(cause), score: ball.explained })
}

/// A ball with its full stiffness predicted, and what the shape of that prediction explains; `None` where it has no
/// equilibrium.
fn with_full_stiffness(search: &mut Search, ball: &Ball) -> Result<Option<(f64, Candidate)>, DiagnosisError> {
    let (_, mut candidate) = first_order(ball);
    let mut supposed = search.current.causes.clone();
    supposed.push(Supposed { cause: candidate.cause.clone(), values: candidate.values.clone() });
    match search.laboratory.predict(&search.current.material, &scene_of(&supposed), search.is_cancelled) {
        Ok(found) => {
            let change = found.trace.plus(-1.0, &search.current.prediction.trace);
            let shape = search.test.test(std::slice::from_ref(&change));
            // The stiffness may become a multiple of the ball's, but not change its sign: that would be another ball.
            let part = shape.coefficients[0];
            let explained = if part > 0.0 { shape.explained } else { 0.0 };
            candidate.values[0] = log_factor_of_ball(part.max(0.1) * change_of_ball(ball.log_factor));
            Ok(Some((explained, candidate)))
        }
        Err(error) if (search.is_cancelled)() => Err(error),
        Err(_) => Ok(None),
    }
}

impl Inclusion {
    /// Starts from a ball of the stiffness map.
    fn of(ball: &Ball) -> Inclusion {
        let Ball { center_mm, radius_mm, log_factor, half_mm, .. } = *ball;
        Inclusion { center_mm, radius_mm, log_factor, half_mm }
    }
}

impl Cause for Inclusion {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Material
    }

    fn description(&self) -> String {
        "a place in the sample is stiffer or softer than the rest".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        let mut all = vec![CauseParameter::new("log_stiffness_factor", 0.3, [-4.0, 4.0])];
        for (a, half) in ["x", "y", "z"].iter().zip(self.half_mm) {
            all.push(CauseParameter::new(format!("center_{a}_mm"), 0.5, [-half, half]));
        }
        let largest = self.half_mm.iter().fold(0.0f64, |s, h| s.max(*h));
        all.push(CauseParameter::new("radius_mm", 0.5, [0.7, largest]));
        all
    }

    fn max_suspects(&self) -> usize {
        2
    }

    fn start(&self) -> Vec<f64> {
        let c = self.center_mm;
        vec![self.log_factor, c[0], c[1], c[2], self.radius_mm]
    }

    fn is_idealised(&self) -> bool {
        true
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        scene.stiffness.push(ball(values, EDGE_MM));
    }

    fn apply_wider(&self, values: &[f64], scene: &mut Scene) -> bool {
        scene.stiffness.push(ball(values, 2.0 * EDGE_MM));
        true
    }

    fn look_alikes(&self, values: &[f64], specimen: &Specimen) -> Vec<Arc<dyn Cause>> {
        if values[0] > HOLLOW {
            return Vec::new();
        }
        Slit::across(specimen, [values[1], values[2], values[3]], values[4])
            .into_iter()
            .map(|slit| Arc::new(slit) as Arc<dyn Cause>)
            .collect()
    }

    fn location(&self, values: &[f64], _: &Specimen) -> Option<Location> {
        let d = 2.0 * values[4];
        let region = if values[0] > 0.0 { "stiff inclusion" } else { "soft inclusion" };
        Some(Location { region: region.into(), center_mm: [values[1], values[2], values[3]], extent_mm: [d; 3] })
    }
}

/// The stiffness factor of a ball whose edge is `edge_mm` wide.
fn ball(values: &[f64], edge_mm: f64) -> Field {
    let (log_factor, center, radius) = (values[0], [values[1], values[2], values[3]], values[4]);
    Field::new(move |x| {
        let r = (0..3).map(|a| (x[a] - center[a]).powi(2)).sum::<f64>().sqrt();
        (log_factor / (1.0 + ((r - radius) / (0.5 * edge_mm)).clamp(-50.0, 50.0).exp())).exp()
    })
}
