//! An entry of the registry: a cause and how a diagnosis comes to suspect it.

use super::candidate::Candidate;
use super::cause::{Cause, CauseName};
use super::error::DiagnosisError;
use super::load_effect::LoadEffect;
use super::material_cause::MaterialCause;
use super::search::Search;
use super::supposed::Supposed;
use super::trace::Trace;
use crate::calibration::Observed;
use crate::specimen::Specimen;
use std::sync::Arc;

/// One cause of the registry.
#[derive(Clone, Copy)]
pub(super) struct Entry {
    /// Its name. Entries of one name are one cause that is suspected in several ways.
    pub(super) name: CauseName,
    /// What a laboratory can do about it, in a sentence of its own.
    pub(super) remedy: &'static str,
    /// How it is suspected.
    pub(super) origin: Origin,
}

impl Entry {
    /// The names of the causes that are special cases of it.
    pub(super) fn special_cases(&self) -> &'static [CauseName] {
        match self.origin {
            Origin::SetUp { special_cases, .. } => special_cases,
            _ => &[],
        }
    }
}

/// How a diagnosis comes to suspect a cause.
#[derive(Clone, Copy)]
pub(super) enum Origin {
    /// It needs no suspicion: every recording is tested for these suspects.
    Tested(fn(&Specimen) -> Vec<Arc<dyn Cause>>),
    /// It is a part of the experiment's set-up, all of which are fitted together where no single cause explains a
    /// misfit.
    SetUp {
        /// The parts for a recording.
        parts: fn(&Observed) -> Vec<Arc<dyn Cause>>,
        /// Causes that are special cases of it (a motion in proportion to the drive of one that is free at every
        /// drive): beside it they say nothing, and in its place they are the simpler explanation.
        special_cases: &'static [CauseName],
    },
    /// It has a place or a direction, which is searched for first (in a map, for instance).
    Searched(fn(&mut Search) -> Result<Vec<Candidate>, DiagnosisError>),
    /// Another cause's fit may end where it looks like this one ([`Cause::look_alikes`]).
    LookAlike,
    /// It is an artefact of the image, found in the residual of the nominal model.
    Artefact {
        /// All artefacts of a residual, with their sizes.
        find: fn(&Observed, &Trace) -> Vec<Supposed>,
        /// What `n` of them are, for messages of progress: "`n` groups of voxels …".
        in_words: &'static str,
    },
    /// It is an effect on the load curve.
    LoadCurve(&'static dyn LoadEffect),
    /// It is a change of the material's own law.
    Material(&'static dyn MaterialCause),
}
