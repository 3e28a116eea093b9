//! The stage of a diagnosis that names causes: single ones round by round, the set-up as a whole where they leave much,
//! and what later causes made needless out again.

use super::artefacts::look_for_artefacts_again;
use super::cause::CauseName;
use super::cause_fit::CauseFit;
use super::diagnose::Run;
use super::error::DiagnosisError;
use super::evidence::{EVIDENCE, UNEXPLAINED, penalty};
use super::findings::Findings;
use super::inference::Inference;
use super::interior::InteriorTest;
use super::leftover::leftover;
use super::metric::Metric;
use super::nominal::fit_with_terms;
use super::rounds::{Asked, RoundLimits, ToAsk, add_causes, fit_round, score_round};
use super::set_up::{fit_set_up, is_set_up_promising, simplest_set_up};
use super::stand_ins::with_sponge_for_stand_ins;
use super::supposed::Supposed;
use super::thinning::{Needed, named_causes, thinned};
use super::trace::Trace;
use std::cell::{Cell, RefCell};

/// The set-up as a whole is looked at where single causes leave more than this part of the misfit (rms), or more than
/// could be called explained.
const SET_UP_LEAVES: f64 = 0.25;
/// It is gone on from where it leaves less than this part of what they leave (rms).
const SET_UP_GAINS: f64 = 0.7;

/// Single causes are given up for the set-up where the first explains less than this part of the deviance, or where one
/// explains a smaller part of what was left than the one before it did.
const LEAST_OF_FIRST: f64 = 0.2;

/// Causes inside the sample no longer wait where those at its boundary have explained so much that less than this part
/// of the misfit (in squares) is left: what is left may be inside.
const MOST: f64 = 0.5;

/// Where causes leave a misfit unexplained, one that alone explained at least this part of what the first did is tried
/// in its place: the greedy choice between two that explain nearly the same may be the wrong one.
const NEARLY_AS_MUCH: f64 = 0.95;
/// What is found from there is kept where it leaves less than this part (rms).
const OTHER_START_GAINS: f64 = 0.9;

/// The artefacts among the causes of a fit.
fn artefacts_of(fitted: &CauseFit) -> Vec<Supposed> {
    fitted.causes.iter().filter(|c| c.cause.is_artefact()).cloned().collect()
}

/// Whether causes that leave `left_mm` of `before_mm` (rms) explain a misfit as far as single causes can be asked to:
/// else the set-up as a whole is fitted in their place.
fn is_explained(left_mm: f64, before_mm: f64, allowance_mm: f64) -> bool {
    left_mm < (SET_UP_LEAVES * before_mm).max(allowance_mm) && left_mm < UNEXPLAINED * allowance_mm
}

/// Whether causes, found one after the other, explain less and less of what was left (`lefts`, before the first and
/// after each): right ones explain more and more of it, down to nothing.
fn explain_ever_less(lefts: &[f64]) -> bool {
    let shares: Vec<f64> = lefts.windows(2).map(|pair| 1.0 - pair[1] / pair[0]).collect();
    match shares[..] {
        [] => false,
        [first] => first < LEAST_OF_FIRST,
        [.., before, last] => last < before,
    }
}

/// Whether causes make up a motion of the plates from several plain ones (`plain`, special cases of free ones) and do
/// not quite come to it: they leave more than the error of a mesh, or a smooth field takes up the rest.
fn make_up_motions(causes: &[Supposed], plain: &[CauseName], leaves_more_than_a_mesh: bool) -> bool {
    let num_plain = causes.iter().filter(|s| plain.contains(&s.cause.name())).count();
    let has_sponge = causes.iter().any(|s| s.cause.is_sponge());
    num_plain > 1 && (has_sponge || leaves_more_than_a_mesh)
}

/// What was found with the set-up as a whole in the fit.
struct WithSetUp {
    findings: Findings,
    /// What its misfits are weighed by ([`Inference::discrepancy_mm2`]).
    discrepancy_mm2: [f64; 3],
}

impl Run<'_> {
    /// Tests, fits and names causes, round by round. Where the interior test found that the inside fits, causes there
    /// wait. Where single causes leave much of the misfit, the set-up as a whole is fitted in their place, and rounds
    /// go on from that.
    pub(super) fn add_causes(&mut self) -> Result<(), DiagnosisError> {
        let measured = self.measured();
        let limits = RoundLimits { max_causes: self.options.max_causes, has_load_curve: self.load.is_some() };
        if self.findings.num_of_fit() >= limits.max_causes {
            return Ok(());
        }
        let at_boundary = self.registry.clone().without_inside();
        let everything =
            Asked { registry: self.registry, with_terms: self.options.prior.is_none(), evidence: EVIDENCE };
        let does_inside_wait = self.interior.as_ref().is_some_and(InteriorTest::inside_fits);
        let first = if does_inside_wait {
            Asked { registry: &at_boundary, with_terms: false, evidence: EVIDENCE }
        } else {
            everything
        };
        let observed = self.observed;
        let Run { inference, findings, .. } = self;
        let left_mm =
            |fitted: &CauseFit, metric: &Metric| leftover(observed, &fitted.residual, metric).structured_rms_mm;
        let before_mm = left_mm(&findings.current, &inference.metric);
        if inference.leaves_no_more_than_a_mesh(&findings.current) {
            return add_causes(inference, findings, &measured, limits, &|_, _| Some(everything));
        }
        let begun = findings.current.clone();
        let scored = score_round(inference, first, findings, limits)?;
        // What is no more than a mesh's needs no set-up.
        let is_promising = before_mm > inference.allowance_mm
            && is_set_up_promising(inference, first.registry, &findings.current, &scored.candidates)?;
        // What was left of the deviance after each cause so far.
        let lefts = RefCell::new(vec![inference.misfit_beyond_noise(&findings.current)]);
        // Whether the last round asked for all causes.
        let are_all_asked = Cell::new(!does_inside_wait);
        let are_given_up = Cell::new(false);
        let to_ask = |inference: &Inference, findings: &Findings| {
            let left = left_mm(&findings.current, &inference.metric);
            lefts.borrow_mut().push(inference.misfit_beyond_noise(&findings.current));
            let is_explained = is_explained(left, before_mm, inference.allowance_mm);
            are_given_up.set(is_promising && !is_explained && explain_ever_less(&lefts.borrow()));
            let are_most_explained = matches!(lefts.borrow()[..], [before, .., last] if last < MOST * before);
            let asks_all = !does_inside_wait || is_explained || are_most_explained;
            let asked = (!are_given_up.get()).then_some(if asks_all { everything } else { first });
            are_all_asked.set(asks_all && asked.is_some());
            asked
        };
        if fit_round(inference, findings, &measured, &scored)? {
            add_causes(inference, findings, &measured, limits, &to_ask)?;
        }
        self.replace_stand_ins(&measured, limits, &to_ask)?;
        let are_all_asked = are_all_asked.get();
        if are_all_asked {
            self.start_otherwise(begun, &measured, limits)?;
            self.fit_material_anew(&measured, limits)?;
        }
        let with_set_up = if is_promising { self.with_set_up(&measured, limits)? } else { None };
        let Some(with_set_up) = with_set_up else {
            return if are_all_asked { Ok(()) } else { self.ask_all(&measured, limits) };
        };
        let gains = |run: &Self| {
            let [with, without] = [&with_set_up.findings, &run.findings].map(|f| &f.current);
            let (left_with, left_without) = (run.left_mm(with), run.left_mm(without));
            // Fewer causes that leave no more are simpler, as free motions are than several plain ones beside a filler.
            let is_simpler = with.causes.len() < without.causes.len() && run.is_explained_by(&run.findings);
            left_with < if is_simpler { left_without } else { SET_UP_GAINS * left_without }
        };
        if !(are_all_asked || gains(self) || self.is_explained_by(&with_set_up.findings)) {
            self.ask_all(&measured, limits)?;
        }
        if gains(self) {
            self.go_on_with(with_set_up);
        }
        Ok(())
    }

    /// Puts a smooth field in the place of causes that stand in for it, and goes on from there with the rounds that are
    /// still `to_ask` for.
    fn replace_stand_ins(
        &mut self,
        measured: &Trace,
        limits: RoundLimits,
        to_ask: ToAsk<'_, '_>,
    ) -> Result<(), DiagnosisError> {
        let Run { inference, registry, findings, .. } = self;
        if let Some(other) = with_sponge_for_stand_ins(inference, registry, measured, &findings.current)? {
            self.findings.current = other;
            self.findings.alternatives.clear();
            self.name_causes_of_fit()?;
            let Run { inference, findings, .. } = self;
            add_causes(inference, findings, measured, limits, to_ask)?;
        }
        Ok(())
    }

    /// Where causes leave a misfit unexplained and another cause alone explained nearly as much of it as the first one
    /// found: adds causes from `begun`, the fit before the first round, without that first one in the first round, and
    /// goes on from there where that leaves clearly less.
    fn start_otherwise(
        &mut self,
        begun: CauseFit,
        measured: &Trace,
        limits: RoundLimits,
    ) -> Result<(), DiagnosisError> {
        let Some(first) = self.findings.causes.iter().find(|c| c.is_of_fit()).map(|c| c.name) else { return Ok(()) };
        let alone = self.findings.ranked.iter().filter(|r| r.round == 1).filter_map(|r| Some((r, r.fitted?)));
        let best = alone.clone().map(|(_, fitted)| fitted).fold(0.0, f64::max);
        let has_rival = alone.clone().any(|(r, fitted)| r.identity.name != first && fitted > NEARLY_AS_MUCH * best);
        if !has_rival || self.is_explained_by(&self.findings) {
            return Ok(());
        }
        self.tell("starting from another cause that explains nearly as much as the first");
        let others = self.registry.clone().without(&[first])?;
        let num_begun = begun.causes.len();
        let from_begun = self.findings.going_on_from(begun);
        let mut before = std::mem::replace(&mut self.findings, from_begun);
        let Run { inference, registry, findings, options, .. } = self;
        let with_terms = options.prior.is_none();
        let added = add_causes(inference, findings, measured, limits, &|_, findings| {
            let is_first = findings.current.causes.len() == num_begun;
            Some(Asked { registry: if is_first { &others } else { registry }, with_terms, evidence: EVIDENCE })
        });
        if added.is_err() || self.left_mm(&self.findings.current) >= OTHER_START_GAINS * self.left_mm(&before.current) {
            (before.ranked, before.maps) =
                (std::mem::take(&mut self.findings.ranked), std::mem::take(&mut self.findings.maps));
            self.findings = before;
        }
        if self.is_cancelled() { added } else { Ok(()) }
    }

    /// Goes on with single causes where they were given up, or not all of them asked.
    fn ask_all(&mut self, measured: &Trace, limits: RoundLimits) -> Result<(), DiagnosisError> {
        let Run { inference, registry, findings, options, .. } = self;
        let everything = Asked { registry, with_terms: options.prior.is_none(), evidence: EVIDENCE };
        add_causes(inference, findings, measured, limits, &|_, _| Some(everything))?;
        self.fit_material_anew(measured, limits)
    }

    /// Where causes leave more than a mesh does: fits the material from its start again, now that they are in the fit,
    /// and goes on from there where that explains more. The nominal fit took terms to make up for what causes do, from
    /// which a fit does not find back. In the end, what later causes made needless goes.
    fn fit_material_anew(&mut self, measured: &Trace, limits: RoundLimits) -> Result<(), DiagnosisError> {
        let is_believed = self.options.prior.is_some();
        let current = &self.findings.current;
        if !is_believed && !current.causes.is_empty() && self.left_mm(current) > self.inference.allowance_mm {
            self.tell("fitting the material anew, with the causes found");
            let (causes, deviance) = (current.causes.clone(), current.deviance);
            let num_terms = current.material.terms.len();
            match fit_with_terms(&mut self.inference, measured, &self.start, &causes) {
                Ok(anew) => {
                    let num_more = anew.material.terms.len() as f64 - num_terms as f64;
                    let cost = num_more * penalty(&self.inference.metric, 2);
                    if deviance - anew.deviance - cost > EVIDENCE {
                        self.findings.current = anew;
                        let Run { inference, registry, findings, .. } = self;
                        let everything = Asked { registry, with_terms: true, evidence: EVIDENCE };
                        add_causes(inference, findings, measured, limits, &|_, _| Some(everything))?;
                    }
                }
                Err(error) if self.is_cancelled() => return Err(error),
                Err(_) => {}
            }
        }
        self.leave_out_what_is_not_needed(measured)
    }

    /// What a fit leaves beyond noise, mm rms.
    fn left_mm(&self, fitted: &CauseFit) -> f64 {
        leftover(self.observed, &fitted.residual, &self.inference.metric).structured_rms_mm
    }

    /// Whether findings explain the misfit as far as causes can be asked to.
    fn is_explained_by(&self, findings: &Findings) -> bool {
        let (before, left) = (self.left_mm(&findings.nominal), self.left_mm(&findings.current));
        is_explained(left, before, self.inference.allowance_mm)
    }

    /// Goes on with the set-up as a whole and the weights that belong to it.
    fn go_on_with(&mut self, with_set_up: WithSetUp) {
        let WithSetUp { mut findings, discrepancy_mm2 } = with_set_up;
        (findings.ranked, findings.maps) =
            (std::mem::take(&mut self.findings.ranked), std::mem::take(&mut self.findings.maps));
        self.findings = findings;
        self.inference.weigh_by(discrepancy_mm2);
    }

    /// Takes out of the fit the causes that `measured`, or later causes, have made needless.
    pub(super) fn leave_out_what_is_not_needed(&mut self, measured: &Trace) -> Result<(), DiagnosisError> {
        let Run { inference, registry, findings, .. } = self;
        let are_artefacts_others = look_for_artefacts_again(inference, registry, findings, measured)?;
        let num_causes = findings.current.causes.len();
        if num_causes > 1 {
            findings.current = thinned(inference, measured, findings.current.clone(), Needed::ByEvidence)?;
        }
        if are_artefacts_others || findings.current.causes.len() < num_causes {
            self.name_causes_of_fit()?;
        }
        Ok(())
    }

    /// The set-up as a whole with causes added to it, where what was named so far leaves much of the misfit: beside the
    /// causes found one by one, and, where both together leave much of it too, alone. `None` where it is not asked
    /// for, or has no fit.
    fn with_set_up(&mut self, measured: &Trace, limits: RoundLimits) -> Result<Option<WithSetUp>, DiagnosisError> {
        let parts = self.registry.set_up(self.observed);
        let of_parts: Vec<Supposed> = parts.into_iter().map(Supposed::at_start).collect();
        let special_cases = self.registry.special_cases(&of_parts);
        let current = &self.findings.current;
        let leaves_more_than_a_mesh = self.left_mm(current) > self.inference.allowance_mm;
        let is_asked = !self.is_explained_by(&self.findings)
            || make_up_motions(&current.causes, &special_cases, leaves_more_than_a_mesh);
        if of_parts.is_empty() || !is_asked {
            return Ok(None);
        }
        // What the set-up has a part for, or takes up, is left to it.
        let is_beside = |c: &&Supposed| {
            let is_part = of_parts.iter().any(|p| p.cause.name() == c.cause.name());
            !(is_part || special_cases.contains(&c.cause.name()) || c.cause.is_sponge() || c.cause.is_artefact())
        };
        let beside: Vec<Supposed> = self.findings.current.causes.iter().filter(is_beside).cloned().collect();
        let together = if beside.is_empty() { None } else { self.set_up_beside(beside, measured, limits)? };
        let before_mm = self.left_mm(&self.findings.nominal);
        if together.as_ref().is_some_and(|f| self.left_mm(&f.findings.current) < SET_UP_LEAVES * before_mm) {
            return Ok(together);
        }
        let alone = self.set_up_beside(Vec::new(), measured, limits)?;
        let left_mm = |found: &WithSetUp| self.left_mm(&found.findings.current);
        Ok([together, alone].into_iter().flatten().min_by(|a, b| left_mm(a).total_cmp(&left_mm(b))))
    }

    /// The set-up as a whole beside some causes, with further causes added to them; `None` where it has no fit.
    fn set_up_beside(
        &mut self,
        beside: Vec<Supposed>,
        measured: &Trace,
        limits: RoundLimits,
    ) -> Result<Option<WithSetUp>, DiagnosisError> {
        self.tell(match beside.is_empty() {
            true => "fitting the set-up as a whole: plates, rig, layers, block",
            false => "fitting the set-up as a whole (plates, rig, layers, block) beside the causes found",
        });
        // Without the further terms that the nominal fit took to make up for the set-up.
        let start = CauseFit {
            material: self.start.clone(),
            causes: artefacts_of(&self.findings.current).into_iter().chain(beside).collect(),
            ..self.findings.nominal.clone()
        };
        let Run { inference, registry, options, .. } = self;
        let fitted = fit_set_up(inference, registry, measured, &start)
            .and_then(|fitted| simplest_set_up(inference, registry, measured, fitted, options.prior.is_none()));
        let found = match fitted {
            Ok(fitted) => self.and_causes(fitted, measured, limits),
            Err(error) => Err(error),
        };
        self.inference.forget_discrepancy();
        match found {
            Ok(found) => Ok(Some(found)),
            Err(error) if self.is_cancelled() => Err(error),
            Err(_) => Ok(None),
        }
    }

    /// What is found from `fitted` on, a fit of the set-up as a whole; the findings so far stay as they are, but for
    /// the list of what was tested.
    fn and_causes(
        &mut self,
        fitted: CauseFit,
        measured: &Trace,
        limits: RoundLimits,
    ) -> Result<WithSetUp, DiagnosisError> {
        let from_set_up = self.findings.going_on_from(fitted);
        let before = std::mem::replace(&mut self.findings, from_set_up);
        self.findings.nominal.deviance = self.inference.misfit_of(&self.findings.nominal.residual);
        let added = self.add_causes_to_set_up(measured, limits);
        let mut findings = std::mem::replace(&mut self.findings, before);
        (self.findings.ranked, self.findings.maps) =
            (std::mem::take(&mut findings.ranked), std::mem::take(&mut findings.maps));
        self.findings.num_rounds = findings.num_rounds;
        added.map(|()| WithSetUp { findings, discrepancy_mm2: self.inference.discrepancy_mm2 })
    }

    /// Adds causes to the set-up as a whole, and names all of them.
    fn add_causes_to_set_up(&mut self, measured: &Trace, limits: RoundLimits) -> Result<(), DiagnosisError> {
        self.name_causes_of_fit()?;
        let Run { inference, registry, findings, options, .. } = self;
        let with_terms = options.prior.is_none();
        let everything = Asked { registry, with_terms, evidence: EVIDENCE };
        let num_before = findings.current.causes.len();
        add_causes(inference, findings, measured, limits, &|_, _| Some(everything))?;
        if findings.current.causes.len() > num_before {
            findings.current = simplest_set_up(inference, registry, measured, findings.current.clone(), with_terms)?;
            self.name_causes_of_fit()?;
        }
        Ok(())
    }

    /// Names the causes that are in the fit, with the evidence for each among all others.
    fn name_causes_of_fit(&mut self) -> Result<(), DiagnosisError> {
        let named = named_causes(&mut self.inference, &self.findings.current)?;
        self.findings.causes.retain(|c| !c.is_of_fit());
        self.findings.causes.extend(named);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnosis::registry::Registry;
    use crate::specimen::Specimen;

    /// Three causes alike: a third, a half, all. Causes that stand for others: a half, then less and less.
    #[test]
    fn causes_that_explain_ever_less_are_given_up() {
        assert!(!explain_ever_less(&[9.0]));
        assert!(!explain_ever_less(&[9.0, 6.0]) && !explain_ever_less(&[9.0, 6.0, 3.0]));
        assert!(explain_ever_less(&[9.0, 8.0]) && explain_ever_less(&[9.0, 5.0, 3.5]));
    }

    /// One plain motion is itself. Several that leave something, or beside a smooth field, stand for a free one.
    #[test]
    fn several_plain_motions_that_leave_something_make_up_a_free_one() {
        let (registry, specimen) =
            (Registry::standard(), Specimen::from_json(include_str!("../../geometries/solid-shear.json")).unwrap());
        let tested = registry.tested(&specimen);
        let causes_of = |names: &[&str]| -> Vec<Supposed> {
            tested.iter().filter(|c| names.contains(&c.name().as_str())).cloned().map(Supposed::at_start).collect()
        };
        let plain = ["offaxis", "mount", "compliance"].map(CauseName::new);
        let makes_up = |names: &[&str], leaves_more: bool| make_up_motions(&causes_of(names), &plain, leaves_more);
        assert!(!makes_up(&["mount"], true) && !makes_up(&["mount", "background"], true));
        assert!(!makes_up(&["mount", "offaxis"], false));
        assert!(makes_up(&["mount", "offaxis"], true));
        assert!(makes_up(&["offaxis", "compliance", "background"], false));
    }
}
