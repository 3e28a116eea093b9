//! One design of a result, with everything that was confirmed of it.

use super::confirm::{Confirmed, Gain, MaterialEvaluation};
use crate::sensitivity::Evaluation;
use crate::specimen::{LimitMargin, Specimen};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// One design of a result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DesignEntry {
    /// The design; its drives are those it is scanned at, which share the time of one scan where there are several.
    pub specimen: Specimen,
    /// The first material's evaluation.
    pub evaluation: Evaluation,
    /// Gain over the base specimen: mean over the meshes of the confirmation.
    pub objective: f64,
    /// Standard error of that mean, relative to it: what meshes leave open.
    #[serde(default)]
    pub mesh_relative_sd: f64,
    /// The limit with the smallest margin, in words.
    pub closest_limit: String,
    /// Everything confirmed: all materials, gains, limits.
    pub by_material: Vec<MaterialEvaluation>,
    /// Gains per material and parameter.
    pub gains: Vec<Gain>,
    /// Every limit, closest first.
    pub limits: Vec<LimitMargin>,
    /// Whether all limits and the guard are kept.
    pub is_within_limits: bool,
    /// Volume of the scanned material, mm³.
    pub volume_mm3: f64,
    /// What is to be known about how it came here: a limit that only the fine mesh broke, or a repair.
    #[serde(default)]
    pub remark: Option<String>,
}

impl DesignEntry {
    /// `None` where nothing was evaluated.
    pub(super) fn of(confirmed: &Confirmed) -> Option<DesignEntry> {
        Some(DesignEntry {
            specimen: confirmed.specimen.clone(),
            evaluation: confirmed.by_material.first()?.evaluation.clone(),
            objective: confirmed.objective,
            mesh_relative_sd: confirmed.mesh_relative_sd,
            closest_limit: confirmed.closest_limit().map_or("none".into(), |m| {
                format!("{}: {:.3} (limit {:.3}, margin {:.1} %)", m.name, m.value, m.limit, 100.0 * m.margin_relative)
            }),
            by_material: confirmed.by_material.clone(),
            gains: confirmed.gains.clone(),
            limits: confirmed.limits.clone(),
            is_within_limits: confirmed.is_within_limits,
            volume_mm3: confirmed.volume_mm3,
            remark: confirmed.remark.clone(),
        })
    }

    /// D-optimal figure of the first material: generalised relative standard deviation.
    pub fn information(&self) -> Option<f64> {
        self.by_material.first()?.relative_sd_by_criterion.d_optimal
    }

    /// Limits that are not kept, in words; guards are meant where every limit is.
    pub fn not_kept(&self) -> String {
        let names: Vec<&str> = self.limits.iter().filter(|m| !m.is_satisfied).map(LimitMargin::plain_name).collect();
        if names.is_empty() { "guard on the promised standard deviations".into() } else { names.join(", ") }
    }

    /// Whether it is the design of `other`, whatever the drive.
    pub fn is_design_of(&self, other: &DesignEntry) -> bool {
        let shape = |e: &DesignEntry| e.specimen.samples().into_iter().map(|s| (s.block, s.holes)).collect::<Vec<_>>();
        self.specimen.test == other.specimen.test && shape(self) == shape(other)
    }

    /// The material that needs the largest force, and that force, N.
    pub fn largest_force(&self) -> Option<(&str, f64)> {
        self.largest(|m| Some(m.force_n))
    }

    /// The material with the largest force across the plates, and that force, N: positive where it pulls them together.
    /// `None` without plates.
    pub fn largest_normal_force(&self) -> Option<(&str, f64)> {
        self.largest(|m| m.normal_force_n)
    }

    /// The material of which a figure is largest by magnitude, and that figure.
    fn largest(&self, of: fn(&MaterialEvaluation) -> Option<f64>) -> Option<(&str, f64)> {
        let known = self.by_material.iter().filter_map(|m| Some((m.material.as_str(), of(m)?)));
        known.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
    }

    /// Largest force over the materials, N.
    pub fn force_n(&self) -> f64 {
        self.by_material.iter().map(|m| m.force_n).fold(0.0, f64::max)
    }
}
