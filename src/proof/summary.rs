//! Sums over the diagnoses of a proof.

use super::draw::HiddenCause;
use super::options::ProofOptions;
use super::result::{CauseSummary, FirstNamed, Proof, Scored};
use crate::diagnosis::Verdict;

/// Sums up all scored diagnoses.
pub(super) fn sum_up(scored: Vec<Scored>, options: &ProofOptions) -> Proof {
    let all = || std::iter::once(HiddenCause::None).chain(HiddenCause::ALL);
    let known: Vec<CauseSummary> = all().filter_map(|c| summary(&scored, c, true)).collect();
    let unknown: Vec<CauseSummary> = all().filter_map(|c| summary(&scored, c, false)).collect();
    let ratio = |a: usize, b: usize| if b == 0 { f64::NAN } else { a as f64 / b as f64 };
    let causes = || known.iter().filter(|k| k.cause != HiddenCause::None);
    let right = causes().map(|k| k.num_right_detectable).sum();
    let detectable = causes().map(|k| k.num_detectable).sum();
    let controls = known.iter().find(|k| k.cause == HiddenCause::None);
    let covered = causes().fold([0, 0], |s, k| [s[0] + k.num_covered[0], s[1] + k.num_covered[1]]);
    let inputs = serde_json::json!({
        "per_cause": options.per_cause, "controls": options.controls, "unknown": options.unknown, "seed": options.seed,
        "mesh_factor": options.mesh_factor, "only": options.only,
    });
    Proof {
        schema: "proof/1".into(),
        right_of_detectable: ratio(right, detectable),
        false_alarm_rate: controls.map_or(f64::NAN, |k| ratio(k.num_recordings - k.num_right, k.num_recordings)),
        unexplained_of_unknown: ratio(
            unknown.iter().map(|k| k.num_right_detectable).sum(),
            unknown.iter().map(|k| k.num_detectable).sum(),
        ),
        interval_coverage: ratio(covered[0], covered[1]),
        scored,
        known,
        unknown,
        version: crate::provenance::VERSION.into(),
        build: crate::provenance::build_id(),
        input_hash: crate::provenance::input_hash(&inputs),
    }
}

/// Sums over one hidden cause, known to the diagnosis or not; `None` where it was not hidden.
fn summary(scored: &[Scored], cause: HiddenCause, is_known: bool) -> Option<CauseSummary> {
    let of: Vec<&Scored> = scored.iter().filter(|s| s.hidden.cause == cause && s.is_known == is_known).collect();
    if of.is_empty() {
        return None;
    }
    let count = |f: &dyn Fn(&Scored) -> bool| of.iter().filter(|s| f(s)).count();
    let mut errors: Vec<f64> = of.iter().filter(|s| s.is_right).filter_map(|s| s.location_error_mm).collect();
    errors.sort_by(f64::total_cmp);
    let covered: Vec<bool> =
        of.iter().filter(|s| s.is_right).flat_map(|s| s.deviations.iter().map(|d| d.1.abs() <= 1.0)).collect();
    let mut first_named: Vec<(FirstNamed, usize)> = Vec::new();
    for s in &of {
        let named = FirstNamed::of(s);
        match first_named.iter_mut().find(|(n, _)| *n == named) {
            Some((_, k)) => *k += 1,
            None => first_named.push((named, 1)),
        }
    }
    first_named.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.to_string().cmp(&b.0.to_string())));
    Some(CauseSummary {
        cause,
        num_recordings: of.len(),
        num_detectable: count(&|s| s.is_detectable),
        num_right: count(&|s| s.is_right),
        num_right_detectable: count(&|s| s.is_right && s.is_detectable),
        num_right_explained: count(&|s| s.is_right && s.is_explained),
        num_silent: count(&|s| s.verdict == Some(Verdict::NoMismatch)),
        median_location_error_mm: errors.get(errors.len() / 2).copied(),
        num_covered: [covered.iter().filter(|c| **c).count(), covered.len()],
        first_named,
    })
}
