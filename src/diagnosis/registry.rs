//! The causes that a diagnosis supposes.

use super::candidate::Candidate;
use super::cause::{Category, Cause, CauseName};
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

/// The causes that a diagnosis supposes: those that come with the program, and causes of one's own beside them.
///
/// ```
/// use lambdak::diagnosis::{Category, Cause, CauseName, CauseParameter, Registry, Scene};
/// use std::sync::Arc;
///
/// /// The image is turned about y.
/// struct TurnedImage;
///
/// impl Cause for TurnedImage {
///     fn name(&self) -> CauseName {
///         CauseName::new("turned_image")
///     }
///     fn category(&self) -> Category {
///         Category::Acquisition
///     }
///     fn description(&self) -> String {
///         "the image is turned about y".into()
///     }
///     fn parameters(&self) -> Vec<CauseParameter> {
///         vec![CauseParameter::new("degrees_about_y", 0.5, [-20.0, 20.0])]
///     }
///     fn apply(&self, values: &[f64], scene: &mut Scene) {
///         scene.image.pose.rotation_rad[1] += values[0].to_radians();
///     }
///     fn changes_sample(&self) -> bool {
///         false
///     }
/// }
///
/// let registry = Registry::standard().with(Arc::new(TurnedImage))?;
/// assert!(registry.names().contains(&CauseName::new("turned_image")));
/// # Ok::<(), lambdak::diagnosis::DiagnosisError>(())
/// ```
#[derive(Clone)]
pub struct Registry {
    entries: Vec<Entry>,
    /// Causes of a program on the library, in the order in which it added them.
    own: Vec<Arc<dyn Cause>>,
}

impl Registry {
    /// All causes that come with the program.
    pub fn standard() -> Registry {
        Registry { entries: REGISTRY.to_vec(), own: Vec::new() }
    }

    /// With a cause of one's own: every recording is tested for it, after the others. Causes that differ in their
    /// variant ([`Cause::variant`]) may share a name.
    ///
    /// Where only the boundary is in question, or only the inside, its category says whether it is asked: causes of
    /// [`Category::Boundary`] act at the boundary, those of [`Category::Material`] inside, all others in both.
    ///
    /// # Errors
    /// [`DiagnosisError::OwnCause`]: the name belongs to a cause that comes with the program, or the cause has no
    /// parameter, a parameter without a positive scale or a range, or a start that lies outside.
    pub fn with(mut self, cause: Arc<dyn Cause>) -> Result<Registry, DiagnosisError> {
        if let Some(problem) = problem_of(&*cause) {
            return Err(DiagnosisError::OwnCause { name: cause.name().as_str(), problem });
        }
        if self.own.iter().any(|c| c.identity() == cause.identity()) {
            let problem = "a cause of this name and variant is there already; give it another variant".into();
            return Err(DiagnosisError::OwnCause { name: cause.name().as_str(), problem });
        }
        self.own.push(cause);
        Ok(self)
    }

    /// Without the causes of some names, and without those of which they are special cases.
    ///
    /// # Errors
    /// [`DiagnosisError::UnknownCause`] for a name that no cause has.
    pub fn without(mut self, names: &[CauseName]) -> Result<Registry, DiagnosisError> {
        let known = self.names();
        if let Some(name) = names.iter().find(|n| !known.contains(n)) {
            let known = known.iter().map(|n| n.as_str()).collect::<Vec<_>>().join(", ");
            return Err(DiagnosisError::UnknownCause { name: name.as_str(), known });
        }
        self.entries.retain(|e| !names.contains(&e.name) && !e.special_cases().iter().any(|n| names.contains(n)));
        self.own.retain(|c| !names.contains(&c.name()));
        Ok(self)
    }

    /// Without the causes that act where the sample is held: plates, bonds, layers, the outline.
    pub(super) fn without_boundary(mut self) -> Registry {
        self.entries.retain(|e| !AT_BOUNDARY.contains(&e.name));
        self.own.retain(|c| c.category() != Category::Boundary);
        self
    }

    /// The causes alone that change nothing but the image, of those for which every recording of a specimen is tested;
    /// without smooth fields that take up whatever is smooth.
    pub(super) fn of_image_alone(mut self, specimen: &Specimen) -> Registry {
        self.entries.retain(|e| match e.origin {
            Origin::Tested(suspects) => suspects(specimen).iter().all(|c| !(c.changes_sample() || c.is_sponge())),
            _ => false,
        });
        self.own.retain(|c| !(c.changes_sample() || c.is_sponge()));
        self
    }

    /// Without the causes that act inside the sample.
    pub(super) fn without_inside(mut self) -> Registry {
        self.entries.retain(|e| !INSIDE.contains(&e.name));
        self.own.retain(|c| c.category() != Category::Material);
        self
    }

    /// The names, each once, in order.
    pub fn names(&self) -> Vec<CauseName> {
        let mut names: Vec<CauseName> = Vec::new();
        for name in self.entries.iter().map(|e| e.name).chain(self.own.iter().map(|c| c.name())) {
            if !names.contains(&name) {
                names.push(name);
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
        self.entries.iter().flat_map(of_entry).chain(self.own.iter().cloned()).collect()
    }

    /// The smooth fields without a mechanism ([`Cause::is_sponge`]), from where they start.
    pub(super) fn sponges(&self, specimen: &Specimen) -> Vec<Supposed> {
        let sponges = self.tested(specimen).into_iter().filter(|c| c.is_sponge());
        sponges.map(Supposed::at_start).collect()
    }

    /// The parameters of the causes for which every recording of a specimen is tested, each once: the cause, the
    /// parameter's number among those of that name, and its name.
    pub fn tested_parameters(&self, specimen: &Specimen) -> Vec<(CauseName, usize, String)> {
        let mut found: Vec<(CauseName, usize, String)> = Vec::new();
        for cause in self.tested(specimen) {
            for parameter in cause.parameters() {
                let own = || found.iter().filter(|(name, ..)| *name == cause.name());
                let place = own().count();
                if !own().any(|(_, _, known)| *known == parameter.name) {
                    found.push((cause.name(), place, parameter.name));
                }
            }
        }
        found
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
    pub(super) fn artefacts(
        &self,
        observed: &Observed,
        residual: &Trace,
        progress: &(dyn Fn(&str) + Sync),
    ) -> Vec<Supposed> {
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

/// What keeps a cause of one's own from being tested.
fn problem_of(cause: &dyn Cause) -> Option<String> {
    let (parameters, start) = (cause.parameters(), cause.start());
    if REGISTRY.iter().any(|e| e.name == cause.name()) {
        return Some("a cause of this name comes with the program; give it another name".into());
    }
    if parameters.is_empty() {
        return Some("it has no parameter; give it one that says how large it is".into());
    }
    if start.len() != parameters.len() {
        return Some(format!("it has {} parameters and {} values to start from", parameters.len(), start.len()));
    }
    for (p, start) in parameters.iter().zip(start) {
        let [low, high] = p.range;
        if !(p.scale > 0.0 && p.scale.is_finite()) {
            return Some(format!("the scale of {} is {}; it must be above 0", p.name, p.scale));
        }
        if !(low < high && (low..=high).contains(&start)) {
            return Some(format!("{} starts from {start}; its range, {low} to {high}, must hold that", p.name));
        }
    }
    None
}

#[cfg(test)]
#[path = "registry_tests.rs"]
mod tests;
