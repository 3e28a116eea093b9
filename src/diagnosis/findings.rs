//! What a diagnosis has found so far.

use super::cause_fit::CauseFit;
use super::found::FoundCause;
use super::maps::ScoreMap;
use super::ranked::Ranked;

/// What the stages of a diagnosis have found so far: each stage reads it and adds to it.
pub(super) struct Findings {
    /// The nominal model's fit.
    pub(super) nominal: CauseFit,
    /// The fit with all causes found so far.
    pub(super) current: CauseFit,
    /// The causes, first found first.
    pub(super) causes: Vec<FoundCause>,
    /// What the data cannot tell apart from them.
    pub(super) alternatives: Vec<FoundCause>,
    /// All suspects that were tested.
    pub(super) ranked: Vec<Ranked>,
    /// Maps of the nominal misfit, with their names.
    pub(super) maps: Vec<(String, ScoreMap)>,
    /// Rounds of tests so far.
    pub(super) num_rounds: usize,
}

impl Findings {
    /// Nothing but a nominal model yet.
    pub(super) fn of_nominal(nominal: CauseFit) -> Findings {
        let current = nominal.clone();
        Findings { nominal, current, causes: vec![], alternatives: vec![], ranked: vec![], maps: vec![], num_rounds: 0 }
    }

    /// Takes another nominal model as the fit so far.
    pub(super) fn restart_from(&mut self, nominal: CauseFit) {
        self.current = nominal.clone();
        self.nominal = nominal;
    }

    /// The same with `current` as the fit so far: its causes are to be named anew.
    pub(super) fn going_on_from(&mut self, current: CauseFit) -> Findings {
        Findings {
            nominal: self.nominal.clone(),
            current,
            causes: self.causes.iter().filter(|c| !c.is_of_fit()).cloned().collect(),
            alternatives: vec![],
            ranked: std::mem::take(&mut self.ranked),
            maps: std::mem::take(&mut self.maps),
            num_rounds: self.num_rounds,
        }
    }

    /// How many causes the displacement is fitted with; a fit of the load curve has its own.
    pub(super) fn num_of_fit(&self) -> usize {
        self.causes.iter().filter(|c| c.is_of_fit()).count()
    }

    /// How much of the deviance causes have explained.
    pub(super) fn explained(&self) -> f64 {
        self.nominal.deviance - self.current.deviance
    }
}
