//! What a study seeks: which figure is maximised, how the figures of several parameters and materials combine, and
//! which figures may not get worse.

use super::study_error::StudyError;
use super::study_limits::{MAX_WEIGHT, ParameterWeight};
use crate::field::FieldPath;
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeMap;
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::{ObjectBuilder, OneOfBuilder, Schema, Type};
use utoipa::{PartialSchema, ToSchema};

/// What is maximised: a gain over the base specimen, 1 for the base itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ObjectiveKind {
    /// Integrated sensitivity 𝒮 of each μᵢ and αᵢ, relative to the base.
    #[default]
    IntegratedSensitivity,
    /// 𝒮 and the inverse of the promised standard deviation of each μᵢ and αᵢ, relative to the base: with `maximin` a
    /// design's gain is one that every one of these figures reaches.
    SensitivityAndPromisedSd,
    /// D-optimal: inverse of the generalised relative standard deviation of all μᵢ, αᵢ.
    DOptimal,
    /// A-optimal: inverse root of the sum of relative variances.
    AOptimal,
    /// E-optimal: inverse root of the largest eigenvalue of the relative covariance.
    EOptimal,
    /// Inverse of the largest relative standard deviation of a single parameter.
    WorstRelativeSd,
    /// T-optimal: how far every material's scan is from the closest fit of an earlier material to it, in noise standard
    /// deviations. Materials stand from the simple to the rich.
    TellApart,
    /// How small errors of the experiment may be and still be named by a diagnosis with 90 % probability: size of the
    /// base over own size, for every parameter of the objective's `causes`.
    Detect,
}

impl ObjectiveKind {
    /// Whether the kind counts 𝒮 per parameter.
    pub fn counts_sensitivity(self) -> bool {
        matches!(self, ObjectiveKind::IntegratedSensitivity | ObjectiveKind::SensitivityAndPromisedSd)
    }

    /// Whether it is of promised standard deviations and nothing else, so that designs compare in any scan.
    pub(super) fn is_of_promises_alone(self) -> bool {
        use ObjectiveKind::{AOptimal, DOptimal, EOptimal, WorstRelativeSd};
        matches!(self, DOptimal | AOptimal | EOptimal | WorstRelativeSd)
    }

    /// The kind in words.
    pub fn words(self) -> &'static str {
        match self {
            ObjectiveKind::IntegratedSensitivity => "integrated sensitivity 𝒮 of every μ and α",
            ObjectiveKind::SensitivityAndPromisedSd => {
                "integrated sensitivity 𝒮 and promised standard deviation of every μ and α"
            }
            ObjectiveKind::DOptimal => "D-optimal figure (generalised standard deviation of all μ and α)",
            ObjectiveKind::AOptimal => "A-optimal figure (root of the summed relative variances)",
            ObjectiveKind::EOptimal => "E-optimal figure (root of the largest eigenvalue of the relative covariance)",
            ObjectiveKind::TellApart => {
                "T-optimal figure (distance of a material's scan from the closest fit of an earlier material)"
            }
            ObjectiveKind::WorstRelativeSd => "largest relative standard deviation of a single parameter",
            ObjectiveKind::Detect => "smallest errors of the experiment that a diagnosis would name",
        }
    }
}

/// How several parameters, and several materials, combine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Combine {
    /// The smallest gain counts.
    #[default]
    Maximin,
    /// The geometric mean of the gains, materials by their weights.
    GeometricMean,
    /// The geometric mean with parameters by `parameter_weights` and materials by their weights.
    Weighted,
}

impl Combine {
    /// The rule in words.
    pub fn words(self) -> &'static str {
        match self {
            Combine::Maximin => "the least gain over all parameters and materials",
            Combine::GeometricMean => "the geometric mean of the gains, materials by their weights",
            Combine::Weighted => "the geometric mean of the gains by the study's weights of parameters and materials",
        }
    }
}

/// What 𝒮 is divided by before designs are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Normalisation {
    /// Σ over voxels, as in the paper: a removed voxel is a lost measurement.
    #[default]
    Sum,
    /// Mean per voxel: how telling a voxel is, whatever their number.
    MeanPerVoxel,
    /// ∫ S dV. Within a study, whose voxels have one size, it ranks as the sum does, but for voxels that are partly
    /// material.
    VolumeIntegral,
}

impl Normalisation {
    /// The normalisation in words.
    pub fn words(self) -> &'static str {
        match self {
            Normalisation::Sum => "sum over voxels",
            Normalisation::MeanPerVoxel => "mean per voxel",
            Normalisation::VolumeIntegral => "volume integral",
        }
    }
}

/// Whose promised standard deviations may not get worse than with the base specimen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Guard {
    /// Nobody's.
    #[default]
    None,
    /// Those of the first material.
    FirstMaterial,
    /// Those of every material.
    EveryMaterial,
}

impl Guard {
    /// Whether the guard covers the prior with this index.
    pub fn covers(self, prior: usize) -> bool {
        match self {
            Guard::None => false,
            Guard::FirstMaterial => prior == 0,
            Guard::EveryMaterial => true,
        }
    }
}

/// A name, or true or false.
impl PartialSchema for Guard {
    fn schema() -> RefOr<Schema> {
        let names = ["none", "first_material", "every_material"];
        let name = ObjectBuilder::new().schema_type(Type::String).enum_values(Some(names));
        let switch = ObjectBuilder::new().schema_type(Type::Boolean);
        let text = "Whose promised standard deviations may not get worse than with the base specimen: nobody's, the first \
                    material's (or true), or every material's.";
        OneOfBuilder::new().item(name).item(switch).description(Some(text)).into()
    }
}

impl ToSchema for Guard {}

/// `true` is short for the first material, `false` for none.
impl<'de> Deserialize<'de> for Guard {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(rename_all = "snake_case")]
        enum Name {
            None,
            FirstMaterial,
            EveryMaterial,
        }
        #[derive(Deserialize)]
        #[serde(
            untagged,
            expecting = "guard_promised_sd must be \"none\", \"first_material\", \"every_material\", true or false"
        )]
        enum Written {
            Switch(bool),
            Name(Name),
        }
        Ok(match Written::deserialize(deserializer)? {
            Written::Switch(false) | Written::Name(Name::None) => Guard::None,
            Written::Switch(true) | Written::Name(Name::FirstMaterial) => Guard::FirstMaterial,
            Written::Name(Name::EveryMaterial) => Guard::EveryMaterial,
        })
    }
}

/// The objective.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Objective {
    /// What is maximised.
    pub kind: ObjectiveKind,
    /// How gains combine.
    pub combine: Combine,
    /// Which 𝒮 is meant.
    pub normalisation: Normalisation,
    /// Weights of parameters by name (`mu_1`, `alpha_1`, …) for `weighted`; a parameter that is not named weighs 1.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    #[schema(value_type = BTreeMap<String, ParameterWeight>)]
    pub parameter_weights: BTreeMap<String, f64>,
    /// Causes that count for `detect`, by name (`gain`) or by one of their parameters (`hole/diameter_error_mm`); gain,
    /// hole and registration where there are none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 100)]
    pub causes: Vec<String>,
    /// Besides: whose μᵢ and αᵢ may not be promised a larger standard deviation than by the base.
    pub guard_promised_sd: Guard,
}

impl Objective {
    /// Weight of a parameter in the combination.
    pub fn weight_of(&self, parameter: &str) -> f64 {
        match self.combine {
            Combine::Weighted => self.parameter_weights.get(parameter).copied().unwrap_or(1.0),
            Combine::Maximin | Combine::GeometricMean => 1.0,
        }
    }

    /// Adds what is wrong with the objective for materials with these parameters: weights that nothing uses, that are
    /// out of their range or that are all zero for a material.
    pub(super) fn check(&self, parameters_of_materials: &[Vec<String>], problems: &mut Vec<StudyError>) {
        let has_weights = !self.parameter_weights.is_empty();
        if has_weights && self.combine != Combine::Weighted {
            problems.push(StudyError::WeightsUnused);
        }
        if self.combine == Combine::Weighted && !self.kind.counts_sensitivity() {
            problems.push(StudyError::NothingToWeigh);
        }
        if !self.causes.is_empty() && self.kind != ObjectiveKind::Detect {
            problems.push(StudyError::CausesUnused);
        }
        for (name, weight) in &self.parameter_weights {
            if !parameters_of_materials.iter().flatten().any(|p| p == name) {
                problems.push(StudyError::UnknownParameter { name: name.clone() });
            }
            if !(0.0..=MAX_WEIGHT).contains(weight) {
                let field = FieldPath::of("objective").name("parameter_weights").name(name);
                let allowed = format!("from 0 to {MAX_WEIGHT}");
                problems.push(StudyError::OutOfRange { field, value: *weight, allowed });
            }
        }
        let has_no_weight = |list: &Vec<String>| list.iter().map(|p| self.weight_of(p)).sum::<f64>() <= 0.0;
        if parameters_of_materials.iter().any(has_no_weight) {
            problems.push(StudyError::NoWeight);
        }
    }

    /// The whole objective in a sentence, for reports.
    pub fn words(&self) -> String {
        let mut text = format!("Maximised: {}", self.kind.words());
        if self.kind.counts_sensitivity() {
            text += &format!(" (𝒮 as {})", self.normalisation.words());
        }
        text += &format!(", as gains over the base specimen; combined as {}", self.combine.words());
        if !self.causes.is_empty() {
            text += &format!("; of the causes {}", self.causes.join(", "));
        }
        if !self.parameter_weights.is_empty() {
            let list: Vec<String> = self.parameter_weights.iter().map(|(p, w)| format!("{p} {w}")).collect();
            text += &format!(" ({}; others 1)", list.join(", "));
        }
        text += match self.guard_promised_sd {
            Guard::None => ".",
            Guard::FirstMaterial => {
                ". Guard: no promised standard deviation of the first material may be larger than the base specimen's."
            }
            Guard::EveryMaterial => {
                ". Guard: no promised standard deviation of any material may be larger than the base specimen's."
            }
        };
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn objective(json: &str) -> Objective {
        serde_json::from_str(json).expect("valid JSON of an objective")
    }

    #[test]
    fn guards_are_named_or_switched() {
        for (json, guard) in [
            ("{}", Guard::None),
            (r#"{"guard_promised_sd": false}"#, Guard::None),
            (r#"{"guard_promised_sd": true}"#, Guard::FirstMaterial),
            (r#"{"guard_promised_sd": "first_material"}"#, Guard::FirstMaterial),
            (r#"{"guard_promised_sd": "every_material"}"#, Guard::EveryMaterial),
        ] {
            let read = objective(json);
            assert_eq!(read.guard_promised_sd, guard);
            // What is written reads back.
            assert_eq!(objective(&serde_json::to_string(&read).expect("it serialises")), read);
        }
        assert!(serde_json::from_str::<Objective>(r#"{"guard_promised_sd": "all"}"#).is_err());
    }

    #[test]
    fn weights_are_checked() {
        let names = vec![vec!["mu_1".to_string(), "alpha_1".to_string()]];
        let fine = objective(r#"{"combine": "weighted", "parameter_weights": {"mu_1": 3, "alpha_1": 0}}"#);
        let problems = |objective: &Objective| {
            let mut problems = Vec::new();
            objective.check(&names, &mut problems);
            problems
        };
        assert!(problems(&fine).is_empty());
        for bad in [
            r#"{"combine": "maximin", "parameter_weights": {"mu_1": 3}}"#,
            r#"{"combine": "weighted", "parameter_weights": {"mu_2": 3}}"#,
            r#"{"combine": "weighted", "parameter_weights": {"mu_1": -1}}"#,
            r#"{"combine": "weighted", "parameter_weights": {"mu_1": 0, "alpha_1": 0}}"#,
            r#"{"combine": "weighted", "kind": "d_optimal"}"#,
        ] {
            assert!(!problems(&objective(bad)).is_empty(), "{bad}");
        }
    }
}
