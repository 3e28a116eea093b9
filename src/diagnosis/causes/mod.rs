//! The registry of causes: what may make a recording differ from its nominal model.
//!
//! Each cause is a small model with parameters that are nominal at zero. Adding one is one file here and one line in
//! [`registry`].

mod background;
mod bond;
mod cell;
mod compliance;
mod debond;
mod fibre;
mod gain;
mod gradient;
mod hole;
mod inclusion;
mod mount;
mod offaxis;
mod registration;
mod slack;
mod swelling;
mod tilt;
mod wrap;

pub use bond::SoftBond;
pub use debond::Debond;
pub use fibre::Fibres;
pub use inclusion::Inclusion;
pub use wrap::Wrap;

use super::scene::Scene;
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// What kind of thing a cause is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Category {
    /// The material.
    Material,
    /// Plates and bonds.
    Boundary,
    /// The sample's shape.
    Geometry,
    /// The scan.
    Acquisition,
    /// Drive and load cell.
    Load,
}

/// A parameter of a cause.
#[derive(Clone, Debug)]
pub struct CauseParameter {
    /// Name with its unit.
    pub name: String,
    /// A size at which the effect would be plain; steps and differences are measured in it.
    pub scale: f64,
    /// Smallest and largest value.
    pub range: [f64; 2],
}

impl CauseParameter {
    fn new(name: impl Into<String>, scale: f64, range: [f64; 2]) -> CauseParameter {
        CauseParameter { name: name.into(), scale, range }
    }
}

/// How the effect of a cause goes with the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Course {
    /// Alike at every drive.
    Alike,
    /// In proportion to the drive.
    InProportion,
    /// As its own model says.
    ItsOwn,
}

/// Where something is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Location {
    /// In words.
    pub region: String,
    /// Its centre in the undeformed sample, mm.
    pub center_mm: [f64; 3],
    /// Its size along x, y, z, mm.
    pub extent_mm: [f64; 3],
}

/// A cause: a small model whose parameters are nominal at zero (those that only say where apart).
pub trait Cause: Send + Sync {
    /// Its name in results.
    fn name(&self) -> &'static str;
    /// Its kind.
    fn category(&self) -> Category;
    /// In words, for people.
    fn description(&self) -> String;
    /// Its parameters.
    fn parameters(&self) -> Vec<CauseParameter>;
    /// Where a fit starts.
    fn start(&self) -> Vec<f64> {
        vec![0.0; self.parameters().len()]
    }
    /// Values that a fit which ended at `values` could not come to by small steps, and that may explain more.
    fn leaps(&self, _values: &[f64]) -> Vec<Vec<f64>> {
        Vec::new()
    }
    /// Changes the scene.
    fn apply(&self, values: &[f64], scene: &mut Scene);
    /// Where it is, if it is somewhere.
    fn location(&self, values: &[f64], specimen: &Specimen) -> Option<Location>;
    /// Whether it changes the sample or its loading, and not only what is recorded of them.
    fn changes_sample(&self) -> bool {
        true
    }
    /// Changes the scene by the same cause with an edge twice as wide, which the data would hardly tell from the first: what that
    /// moves, parameters are not known better than. `false`: it has no edge.
    fn apply_wider(&self, _values: &[f64], _scene: &mut Scene) -> bool {
        false
    }
    /// How it goes with the drive: where the same pattern explains more if it goes otherwise, this is not the cause.
    fn course(&self) -> Course {
        Course::ItsOwn
    }
    /// Whether one drive alone could not tell it from what grows with the drive.
    fn needs_several_drives(&self) -> bool {
        false
    }
}

/// Causes that every recording is tested for by score tests. Those with a place or a direction to find (debonds, soft
/// bonds, inclusions, jumps, fibres) are made from maps instead.
pub fn registry(specimen: &Specimen) -> Vec<Arc<dyn Cause>> {
    let mut all: Vec<Arc<dyn Cause>> = vec![
        Arc::new(gradient::Gradient::of(specimen)),
        Arc::new(swelling::Swelling),
        Arc::new(tilt::Tilt::of(specimen)),
        Arc::new(offaxis::OffAxis::of(specimen)),
        Arc::new(mount::Mount),
        Arc::new(compliance::Compliance),
        Arc::new(slack::Slack),
        Arc::new(gain::Gain),
        Arc::new(background::Background),
        Arc::new(registration::Registration),
        Arc::new(cell::CellOffset),
    ];
    for hole in 0..specimen.holes.len() {
        all.push(Arc::new(hole::HoleError::of(specimen, hole)));
    }
    all
}
