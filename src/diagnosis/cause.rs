//! What a cause is: a small model with parameters, which makes a recording differ from its nominal model.

use super::location::Location;
use super::scene::Scene;
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use utoipa::ToSchema;

/// The public name of a cause, as results state it (`tilt`, `debond`, …). Every cause names itself once, in its own
/// file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(transparent)]
pub struct CauseName(&'static str);

impl CauseName {
    /// A name for results: lower case, without spaces.
    pub const fn new(name: &'static str) -> CauseName {
        CauseName(name)
    }

    /// As results write it.
    pub const fn as_str(self) -> &'static str {
        self.0
    }
}

impl std::fmt::Display for CauseName {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(self.0)
    }
}

/// What kind of thing a cause is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
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
    /// A change of the parameter whose effect would be plain to see. Steps of fits and differences for derivatives are
    /// measured in it.
    pub scale: f64,
    /// Smallest and largest value.
    pub range: [f64; 2],
    /// Standard deviation of what a laboratory believes of it before it looks, around the cause's start; `None` where
    /// nothing is believed.
    pub believed_sd: Option<f64>,
    /// The only step of the recording that it changes, where it is one.
    pub only_step: Option<usize>,
    /// Whether it belongs to the rig or the scanner, and so is one number in all recordings of an acquisition.
    pub is_of_rig: bool,
}

impl CauseParameter {
    /// A parameter with its scale and range.
    pub fn new(name: impl Into<String>, scale: f64, range: [f64; 2]) -> CauseParameter {
        CauseParameter { name: name.into(), scale, range, believed_sd: None, only_step: None, is_of_rig: false }
    }

    /// The same, believed to be within about `sd` of the start.
    pub fn believed(self, sd: f64) -> CauseParameter {
        CauseParameter { believed_sd: Some(sd), ..self }
    }

    /// The same, of the rig or the scanner.
    pub fn of_rig(self) -> CauseParameter {
        CauseParameter { is_of_rig: true, ..self }
    }

    /// The same, of one step alone.
    pub fn of_step(self, step: usize) -> CauseParameter {
        CauseParameter { only_step: Some(step), ..self }
    }
}

/// The course of a cause over the drives: how its effect changes from one drive to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Course {
    /// The effect is the same at every drive.
    Alike,
    /// The effect grows in proportion to the drive.
    InProportion,
    /// The effect follows from the cause's own model and from nothing simpler.
    ItsOwn,
}

/// What tells one suspect from another: its name and, where there may be several suspects of one name, which of them it
/// is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CauseIdentity {
    /// The name.
    pub name: CauseName,
    /// Which one of that name: the number of a hole, a face, a direction in hundredths, …
    pub variant: [i64; 3],
}

/// A cause: a small model whose parameters are zero in the nominal experiment. (Parameters that say where a cause is
/// have no such value.)
pub trait Cause: Send + Sync {
    /// Its name in results.
    fn name(&self) -> CauseName;
    /// Its kind.
    fn category(&self) -> Category;
    /// In words, for people.
    fn description(&self) -> String;
    /// What a laboratory can do about it, in a sentence. The registry has one for every cause that comes with the
    /// program; a cause of one's own may have its own.
    fn remedy(&self) -> String {
        String::new()
    }
    /// Its parameters.
    fn parameters(&self) -> Vec<CauseParameter>;
    /// Values of the parameters from which a fit starts.
    fn start(&self) -> Vec<f64> {
        vec![0.0; self.parameters().len()]
    }
    /// Changes the scene as the cause does with these values of its parameters.
    fn apply(&self, values: &[f64], scene: &mut Scene);
    /// The place of the cause; `None` for a cause that acts everywhere.
    fn location(&self, _values: &[f64], _specimen: &Specimen) -> Option<Location> {
        None
    }
    /// Which one of its name it is, where there may be several.
    fn variant(&self) -> [i64; 3] {
        [0; 3]
    }
    /// What tells it from other suspects.
    fn identity(&self) -> CauseIdentity {
        CauseIdentity { name: self.name(), variant: self.variant() }
    }
    /// How many suspects of its name are fitted in full in one round. More than one where suspects differ in their
    /// place or direction and first order does not tell reliably which of them is right.
    fn max_suspects(&self) -> usize {
        1
    }
    /// Whether it is a flaw of the image that belongs to this recording alone. Artefacts are taken out before causes
    /// are looked for, do not count among them, and say nothing about other recordings.
    fn is_artefact(&self) -> bool {
        false
    }
    /// Whether the load curve tells of it, so that the steps' mean forces are not searched for it where there is a load
    /// curve.
    fn is_read_from_load_curve(&self) -> bool {
        false
    }
    /// Whether it changes the sample or its loading. A cause that changes only what is recorded needs no equilibrium of
    /// its own.
    fn changes_sample(&self) -> bool {
        true
    }
    /// The course of its effect over the drives. A cause is refuted where the same pattern with the opposite course
    /// (alike in place of in proportion, or the other way round) explains more.
    fn course(&self) -> Course {
        Course::ItsOwn
    }
    /// Whether a recording of a single drive cannot tell it from another cause that grows with the drive.
    fn needs_several_drives(&self) -> bool {
        false
    }
    /// Whether it changes nothing but how the plates move, and nothing of the image.
    fn moves_only_plates(&self) -> bool {
        false
    }
    /// Whether it is a part of the set-up, held by what a laboratory believes.
    fn is_of_set_up(&self) -> bool {
        false
    }
    /// Whether its model simplifies the shape of what it stands for, so that it errs by some percent of its effect.
    fn is_idealised(&self) -> bool {
        false
    }
    /// Whether it is a smooth field without a mechanism, which takes up whatever is smooth.
    fn is_sponge(&self) -> bool {
        false
    }
    /// Whether it has so many parameters at the sample's surface that it follows what a mesh gets wrong.
    fn follows_mesh_errors(&self) -> bool {
        false
    }
    /// Leaps: values that a fit which ended at `values` could not reach by small steps, and that may explain more.
    fn leaps(&self, _values: &[f64]) -> Vec<Vec<f64>> {
        Vec::new()
    }
    /// Look-alikes: other causes that a fit which ended at `values` may have found in truth, each to be fitted from its
    /// start.
    fn look_alikes(&self, _values: &[f64], _specimen: &Specimen) -> Vec<Arc<dyn Cause>> {
        Vec::new()
    }
    /// Changes the scene by the same cause with an edge twice as wide, and says so by `true`; `false` where the cause
    /// has no edge.
    ///
    /// The data hardly tell the wider edge from the first. How far a parameter moves between the two is therefore a
    /// part of its uncertainty.
    fn apply_wider(&self, _values: &[f64], _scene: &mut Scene) -> bool {
        false
    }
}
