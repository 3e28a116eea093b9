//! The study (`study/1`): a base specimen, what may vary, for which materials, how it is scanned, what can be made, what
//! is sought and how hard.

use super::aim::{Objective, ObjectiveKind};
use crate::material::Ogden;
use crate::sensitivity::ScanSettings;
use crate::specimen::{ManufacturingLimits, Specimen, Symmetry, TestKind};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Why a study cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudyError {
    /// The text is not a study.
    #[error("not a study/1: {message}")]
    Json {
        /// Line, column and field.
        message: String,
    },
    /// A file that the study names cannot be used.
    #[error("{}: {message}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        message: String,
    },
    /// A value is out of its range.
    #[error("{field} is {value}; it must be {allowed}")]
    OutOfRange {
        /// Field of the study.
        field: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// Two parts contradict each other.
    #[error("{message}")]
    Inconsistent {
        /// What contradicts what.
        message: String,
    },
}

/// A study as written: files may be named instead of spelled out.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StudyFile {
    schema: String,
    name: String,
    base: Inline<Specimen>,
    materials: Vec<MaterialEntry>,
    scan: ScanSettings,
    vary: Vary,
    limits: ManufacturingLimits,
    #[serde(default)]
    objective: Objective,
    #[serde(default)]
    budget: Budget,
    #[serde(default)]
    verification: VerificationSettings,
    #[serde(default = "default_seed")]
    seed: u64,
}

fn default_seed() -> u64 {
    1
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(untagged)]
pub(crate) enum Inline<T> {
    File(PathBuf),
    Value(T),
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MaterialEntry {
    name: String,
    material: Inline<Ogden>,
    #[serde(default)]
    relative_sd: f64,
    #[serde(default = "unit")]
    weight: f64,
}

fn unit() -> f64 {
    1.0
}

/// A material prior.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialPrior {
    /// Name in results.
    pub name: String,
    /// Central values.
    pub material: Ogden,
    /// Relative standard deviation of the prior: each design is also judged with all α raised and all μ lowered by it,
    /// and the reverse (0: at the central values only).
    pub relative_sd: f64,
    /// Weight in averages over materials.
    pub weight: f64,
}

/// What may vary; what is absent stays as in the base specimen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Vary {
    /// Kinds of test.
    #[serde(default)]
    pub tests: Vec<TestKind>,
    /// Numbers of holes.
    pub hole_count: CountRange,
    /// Directions of the holes.
    #[serde(default)]
    pub axes: Vec<crate::specimen::HoleAxis>,
    /// The drive, mm.
    pub drive_mm: Range,
    /// Length of the block, mm.
    #[serde(default)]
    pub length_mm: Option<Range>,
    /// Thickness of the block, mm.
    #[serde(default)]
    pub thickness_mm: Option<Range>,
    /// Width of the block, mm.
    #[serde(default)]
    pub width_mm: Option<Range>,
}

/// Two counts, both included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CountRange {
    /// Smallest.
    pub min: usize,
    /// Largest.
    pub max: usize,
}

/// Two numbers, both included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
}

/// How many evaluations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Budget {
    /// Designs sampled.
    pub explore: usize,
    /// Designs improved with gradients.
    pub refine: usize,
    /// Gradient steps of each.
    pub iterations: usize,
    /// Designs confirmed on a finer mesh with the scan's voxels.
    pub confirm: usize,
    /// Whether the search judges every design at the priors' stiffer and softer variants too. If not, it is judged at the
    /// central values, three times as many designs are seen in the same time, and the variants enter at confirmation.
    pub variants_in_search: bool,
}

impl Default for Budget {
    fn default() -> Self {
        Budget { explore: 160, refine: 6, iterations: 12, confirm: 10, variants_in_search: true }
    }
}

/// The verification by calibration on synthetic noisy scans.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VerificationSettings {
    /// Whether it is done.
    pub is_on: bool,
    /// Noise draws per specimen and material.
    pub draws: usize,
}

impl Default for VerificationSettings {
    fn default() -> Self {
        VerificationSettings { is_on: true, draws: 20 }
    }
}

/// A validated study with its files read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Study {
    /// Free name.
    pub name: String,
    /// What designs are compared with.
    pub base: Specimen,
    /// Material priors; the first is the main one.
    pub materials: Vec<MaterialPrior>,
    /// The scan.
    pub scan: ScanSettings,
    /// What may vary.
    pub vary: Vary,
    /// What can be made and measured.
    pub limits: ManufacturingLimits,
    /// What is sought.
    pub objective: Objective,
    /// How hard.
    pub budget: Budget,
    /// The proof.
    pub verification: VerificationSettings,
    /// Seed of everything random.
    pub seed: u64,
}

impl Study {
    /// Reads a study; files that it names are looked for beside it, in `folder`.
    ///
    /// # Errors
    /// [`StudyError`].
    pub fn from_json(text: &str, folder: &Path) -> Result<Study, StudyError> {
        let file: StudyFile = serde_json::from_str(text).map_err(|e| StudyError::Json { message: e.to_string() })?;
        if file.schema != "study/1" {
            return Err(StudyError::Json { message: format!("schema is '{}', expected 'study/1'", file.schema) });
        }
        let base = resolve(file.base, folder, Specimen::from_json)?;
        let materials = file
            .materials
            .into_iter()
            .map(|entry| {
                Ok(MaterialPrior {
                    name: entry.name,
                    material: resolve(entry.material, folder, Ogden::from_json)?,
                    relative_sd: entry.relative_sd,
                    weight: entry.weight,
                })
            })
            .collect::<Result<Vec<_>, StudyError>>()?;
        let study = Study {
            name: file.name,
            base,
            materials,
            scan: file.scan,
            vary: file.vary,
            limits: file.limits,
            objective: file.objective,
            budget: file.budget,
            verification: file.verification,
            seed: file.seed,
        };
        study.validate()?;
        Ok(study)
    }

    fn validate(&self) -> Result<(), StudyError> {
        self.base.validate().map_err(|e| StudyError::Inconsistent { message: format!("base: {e}") })?;
        self.limits.validate().map_err(|e| StudyError::Inconsistent { message: format!("limits: {e}") })?;
        if self.materials.is_empty() {
            return Err(StudyError::Inconsistent { message: "materials is empty; give at least one".into() });
        }
        for prior in &self.materials {
            prior
                .material
                .validate()
                .map_err(|e| StudyError::Inconsistent { message: format!("material '{}': {e}", prior.name) })?;
            range("materials.relative_sd", prior.relative_sd, 0.0, 0.5, "from 0 to 0.5")?;
            range("materials.weight", prior.weight, 1e-6, 1e6, "positive")?;
        }
        let vary = &self.vary;
        range("vary.hole_count.max", vary.hole_count.max as f64, 0.0, 8.0, "from 0 to 8")?;
        if vary.hole_count.min > vary.hole_count.max {
            return Err(StudyError::Inconsistent { message: "vary.hole_count: min exceeds max".into() });
        }
        for (field, interval) in [
            ("vary.drive_mm", Some(vary.drive_mm)),
            ("vary.length_mm", vary.length_mm),
            ("vary.thickness_mm", vary.thickness_mm),
            ("vary.width_mm", vary.width_mm),
        ] {
            if let Some(r) = interval {
                range(field, r.min, 1e-3, 1e3, "positive, at most 1000 mm")?;
                range(field, r.max, r.min, 1e3, "at least its min, at most 1000 mm")?;
            }
        }
        if let Some(limit) = self.limits.max_drive_mm
            && vary.drive_mm.min > limit
        {
            return Err(StudyError::Inconsistent {
                message: format!(
                    "vary.drive_mm.min is {} mm and limits.max_drive_mm {limit} mm; no drive keeps both",
                    vary.drive_mm.min
                ),
            });
        }
        let names = |prior: &MaterialPrior| {
            let parameters = prior.material.parameters().into_iter().map(|p| p.name());
            parameters.filter(|n| n != "kappa").collect::<Vec<_>>()
        };
        if self.objective.kind == ObjectiveKind::TellApart && self.materials.len() < 2 {
            let message = "objective.kind: tell_apart needs at least two materials to tell apart".into();
            return Err(StudyError::Inconsistent { message });
        }
        self.objective.validate(&self.materials.iter().map(names).collect::<Vec<_>>())?;
        for (field, value) in [
            ("budget.explore", self.budget.explore),
            ("budget.refine", self.budget.refine),
            ("budget.iterations", self.budget.iterations),
            ("budget.confirm", self.budget.confirm),
            ("verification.draws", self.verification.draws),
        ] {
            range(field, value as f64, 1.0, 1e6, "from 1 to 1000000")?;
        }
        if self.limits.symmetry == Symmetry::MirrorY || self.limits.symmetry == Symmetry::MirrorXAndY {
            return Err(StudyError::Inconsistent {
                message: "limits.symmetry: a design search supports none, mirror_x, mirror_z, mirror_x_and_z and point"
                    .into(),
            });
        }
        Ok(())
    }

    /// Drives to try, mm: `vary.drive_mm`, never above `limits.max_drive_mm`.
    pub fn drive_range(&self) -> Range {
        let Range { min, max } = self.vary.drive_mm;
        Range { min, max: self.limits.max_drive_mm.map_or(max, |limit| max.min(limit)) }
    }

    /// Kinds of test to try.
    pub fn tests(&self) -> Vec<TestKind> {
        if self.vary.tests.is_empty() { vec![self.base.test] } else { self.vary.tests.clone() }
    }
}

fn range(field: &'static str, value: f64, low: f64, high: f64, allowed: &'static str) -> Result<(), StudyError> {
    if value >= low && value <= high { Ok(()) } else { Err(StudyError::OutOfRange { field, value, allowed }) }
}

/// The value, or what the file named beside the study holds.
pub(crate) fn resolve<T, E: std::fmt::Display>(
    inline: Inline<T>,
    folder: &Path,
    parse: impl Fn(&str) -> Result<T, E>,
) -> Result<T, StudyError> {
    match inline {
        Inline::Value(value) => Ok(value),
        Inline::File(name) => {
            let path = folder.join(name);
            let text = std::fs::read_to_string(&path)
                .map_err(|e| StudyError::File { path: path.clone(), message: e.to_string() })?;
            parse(&text).map_err(|e| StudyError::File { path, message: e.to_string() })
        }
    }
}
