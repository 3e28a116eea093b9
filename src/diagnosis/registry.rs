//! The causes that a diagnosis supposes.

use super::candidate::Candidate;
use super::cause::{Cause, CauseName};
use super::causes::{AT_BOUNDARY, INSIDE, REGISTRY};
use super::entry::{Entry, Origin};
use super::error::DiagnosisError;
use super::load_effect::LoadEffect;
use super::material_cause::MaterialCause;
use super::search::Search;
use super::supposed::Supposed;
use super::trace::Trace;
use crate::calibration::Observed;
use crate::specimen::Specimen;
use std::sync::Arc;

/// The names of all causes, in the order of the registry.
pub fn cause_names() -> Vec<CauseName> {
    Registry::standard().names()
}

/// What a laboratory can do about a cause.
pub(super) fn remedy_of(name: CauseName) -> &'static str {
    // Every name of a cause stands in the registry.
    REGISTRY.iter().find(|e| e.name == name).map_or("", |e| e.remedy)
}

/// Whether naming `named` answers what was hidden: it is the same cause, a special case of it, or one of which it is a
/// special case.
pub fn answers(hidden: CauseName, named: &str) -> bool {
    let covers = |general: &str, special: &str| {
        REGISTRY.iter().any(|e| e.name.as_str() == general && e.special_cases().iter().any(|c| c.as_str() == special))
    };
    hidden.as_str() == named || covers(named, hidden.as_str()) || covers(hidden.as_str(), named)
}

/// The causes that a diagnosis supposes.
#[derive(Clone)]
pub(super) struct Registry {
    entries: Vec<Entry>,
}

impl Registry {
    /// All causes.
    pub(super) fn standard() -> Registry {
        Registry { entries: REGISTRY.to_vec() }
    }

    /// Without the causes of some names, and without those of which they are special cases.
    ///
    /// # Errors
    /// [`DiagnosisError::UnknownCause`] for a name that no cause has.
    pub(super) fn without(mut self, names: &[CauseName]) -> Result<Registry, DiagnosisError> {
        let known = self.names();
        if let Some(name) = names.iter().find(|n| !known.contains(n)) {
            let known = known.iter().map(|n| n.as_str()).collect::<Vec<_>>().join(", ");
            return Err(DiagnosisError::UnknownCause { name: name.as_str(), known });
        }
        self.entries.retain(|e| !names.contains(&e.name) && !e.special_cases().iter().any(|n| names.contains(n)));
        Ok(self)
    }

    /// Without the causes that act where the sample is held: plates, bonds, layers, the outline.
    pub(super) fn without_boundary(mut self) -> Registry {
        self.entries.retain(|e| !AT_BOUNDARY.contains(&e.name));
        self
    }

    /// The causes alone that change nothing but the image, of those for which every recording of a specimen is tested;
    /// without smooth fields that take up whatever is smooth.
    pub(super) fn of_image_alone(mut self, specimen: &Specimen) -> Registry {
        self.entries.retain(|e| match e.origin {
            Origin::Tested(suspects) => suspects(specimen).iter().all(|c| !(c.changes_sample() || c.is_sponge())),
            _ => false,
        });
        self
    }

    /// Without the causes that act inside the sample.
    pub(super) fn without_inside(mut self) -> Registry {
        self.entries.retain(|e| !INSIDE.contains(&e.name));
        self
    }

    /// The names, each once, in order.
    pub(super) fn names(&self) -> Vec<CauseName> {
        let mut names: Vec<CauseName> = Vec::new();
        for entry in &self.entries {
            if !names.contains(&entry.name) {
                names.push(entry.name);
            }
        }
        names
    }

    /// The names of the causes that are special cases of one in `causes`.
    pub(super) fn special_cases(&self, causes: &[Supposed]) -> Vec<CauseName> {
        let is_in = |e: &&Entry| causes.iter().any(|c| c.cause.name() == e.name);
        self.entries.iter().filter(is_in).flat_map(|e| e.special_cases()).copied().collect()
    }

    /// Suspects for which every recording of a specimen is tested.
    pub(super) fn tested(&self, specimen: &Specimen) -> Vec<Arc<dyn Cause>> {
        let of_entry = |entry: &Entry| match entry.origin {
            Origin::Tested(suspects) => suspects(specimen),
            _ => Vec::new(),
        };
        self.entries.iter().flat_map(of_entry).collect()
    }

    /// The parts of the set-up of a recording.
    pub(super) fn set_up(&self, observed: &Observed) -> Vec<Arc<dyn Cause>> {
        let of_entry = |entry: &Entry| match entry.origin {
            Origin::SetUp { parts, .. } => parts(observed),
            _ => Vec::new(),
        };
        self.entries.iter().flat_map(of_entry).collect()
    }

    /// Suspects with a place or a direction, added to `candidates` cause by cause.
    ///
    /// # Errors
    /// [`DiagnosisError`].
    pub(super) fn search(&self, search: &mut Search, candidates: &mut Vec<Candidate>) -> Result<(), DiagnosisError> {
        for entry in &self.entries {
            if let Origin::Searched(suspects) = entry.origin {
                search.top = candidates.iter().fold(0.0, |top: f64, c| top.max(c.score));
                candidates.extend(suspects(search)?);
            }
        }
        Ok(())
    }

    /// Artefacts of a residual; `progress` is told how many there are.
    pub(super) fn artefacts(&self, observed: &Observed, residual: &Trace, progress: &dyn Fn(&str)) -> Vec<Supposed> {
        let mut all = Vec::new();
        for entry in &self.entries {
            if let Origin::Artefact { find, in_words } = entry.origin {
                let found = find(observed, residual);
                if !found.is_empty() {
                    progress(&format!("{} {in_words}", found.len()));
                }
                all.extend(found);
            }
        }
        all
    }

    /// Effects on the load curve.
    pub(super) fn load_effects(&self) -> Vec<&'static dyn LoadEffect> {
        let of_entry = |entry: &Entry| match entry.origin {
            Origin::LoadCurve(effect) => Some(effect),
            _ => None,
        };
        self.entries.iter().filter_map(of_entry).collect()
    }

    /// Causes in the material's own law.
    pub(super) fn material_causes(&self) -> Vec<&'static dyn MaterialCause> {
        let of_entry = |entry: &Entry| match entry.origin {
            Origin::Material(cause) => Some(cause),
            _ => None,
        };
        self.entries.iter().filter_map(of_entry).collect()
    }
}

#[cfg(test)]
#[path = "registry_tests.rs"]
mod tests;
