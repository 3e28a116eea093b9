//! The interior test: before any cause is named, whether a misfit was made at the boundary or inside.
//!
//! A part of the sample between two planes along its bonded faces is driven by the displacement that was measured on
//! the planes ([`Observed::between_measured_planes`]). What vanishes of the misfit there was the set-up: plates, bonds,
//! mount. What stays is the material's or the scan's.

use super::error::DiagnosisError;
use super::inference::Inference;
use super::laboratory::Laboratory;
use super::leftover::leftover;
use super::metric::Metric;
use super::nominal::fit_nominal;
use super::trace::Trace;
use crate::calibration::{CUT_PART, Observed};
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::rate::BeforeAfter;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A misfit was made at the boundary where the interior test leaves less than this part of it (rms).
const VANISHES: f64 = 0.4;
/// The inside fits, so that causes there can wait, where it leaves less than this part.
const INSIDE_FITS: f64 = 0.2;
/// It was made inside where the test leaves more than this part (rms).
const STAYS: f64 = 0.8;

/// Where a misfit was made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum MisfitOrigin {
    /// At the boundary: plates, bonds, mount.
    SetUp,
    /// Inside: the material or the scan.
    Inside,
    /// At the boundary and inside.
    Both,
}

impl MisfitOrigin {
    /// In words.
    pub fn in_words(self) -> &'static str {
        match self {
            MisfitOrigin::SetUp => "the set-up was not as told: driven by what was measured, the inside fits",
            MisfitOrigin::Inside => "the misfit is inside: it is the material's or the scan's, not the set-up's",
            MisfitOrigin::Both => "a part of the misfit is the set-up's, a part is inside",
        }
    }
}

/// What the interior test found, on the voxels between the planes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct InteriorTest {
    /// Where the misfit was made.
    pub origin: MisfitOrigin,
    /// χ² of the displacement per datum: with the plates as commanded, and driven by what was measured.
    pub chi2_per_datum: BeforeAfter,
    /// Misfit beyond noise, mm rms, likewise.
    pub structured_rms_mm: BeforeAfter,
    /// Distance of the planes from the middle of the sample, mm.
    pub plane_mm: f64,
}

impl InteriorTest {
    /// The part of the misfit that the test leaves (rms).
    fn share(&self) -> f64 {
        self.structured_rms_mm.after / self.structured_rms_mm.before.max(1e-12)
    }

    /// Whether so little of the misfit was made inside that causes there can wait.
    pub(super) fn inside_fits(&self) -> bool {
        self.share() < INSIDE_FITS
    }
}

/// Tests the interior of `observed`, of which the nominal model leaves `residual`; `None` where the test cannot be
/// made, which progress says why.
///
/// # Errors
/// [`DiagnosisError`]: the work was cancelled.
pub(super) fn test_interior(
    inference: &Inference,
    observed: &Observed,
    residual: &Trace,
    start: &Material,
) -> Result<Option<InteriorTest>, DiagnosisError> {
    (inference.progress)("interior test: the inside driven by what was measured around it");
    let part = match observed.between_measured_planes(CUT_PART) {
        Ok(part) => part,
        Err(error) => {
            (inference.progress)(&format!("no interior test: {error}"));
            return Ok(None);
        }
    };
    match fitted_inside(inference, observed, &part, residual, start) {
        Ok(found) => Ok(Some(found)),
        Err(error) if (inference.is_cancelled)() => Err(error),
        Err(error) => {
            (inference.progress)(&format!("no interior test: {error}"));
            Ok(None)
        }
    }
}

fn fitted_inside(
    inference: &Inference,
    observed: &Observed,
    part: &Observed,
    residual: &Trace,
    start: &Material,
) -> Result<InteriorTest, DiagnosisError> {
    let mesh = MeshOptions::scaled(&part.specimen, inference.mesh_factor);
    let mut inside = Inference {
        laboratory: Laboratory::new(part, &mesh)?,
        metric: Metric::new(part, inference.allowance_mm, &|_| true),
        settings: inference.settings,
        nominal_bulk: inference.nominal_bulk,
        believed_bulk: inference.believed_bulk,
        allowance_mm: inference.allowance_mm,
        discrepancy_mm2: [0.0; 3],
        mesh_factor: inference.mesh_factor,
        is_cancelled: inference.is_cancelled,
        progress: inference.progress,
    };
    let measured = inside.laboratory.measured();
    let fitted = fit_nominal(&mut inside, &measured, start, true)?;
    let before = leftover(part, &restricted(observed, part, residual), &inside.metric);
    let after = leftover(part, &fitted.residual, &inside.metric);
    let of = |before: f64, after: f64| BeforeAfter { before, after };
    let mut found = InteriorTest {
        origin: MisfitOrigin::Both,
        chi2_per_datum: of(before.chi2_per_datum, after.chi2_per_datum),
        structured_rms_mm: of(before.structured_rms_mm, after.structured_rms_mm),
        plane_mm: (0.5 - CUT_PART) * across_mm(observed),
    };
    if found.share() < VANISHES || after.structured_rms_mm < inference.allowance_mm {
        found.origin = MisfitOrigin::SetUp;
    } else if found.share() > STAYS {
        found.origin = MisfitOrigin::Inside;
    }
    Ok(found)
}

/// Extent of the sample across its bonded faces, mm.
fn across_mm(observed: &Observed) -> f64 {
    match observed.specimen.test {
        crate::specimen::TestKind::DoubleLapShear => observed.specimen.block.thickness_mm,
        crate::specimen::TestKind::Uniaxial => observed.specimen.block.length_mm,
    }
}

/// A residual of the whole recording at the voxels and steps of its part.
fn restricted(whole: &Observed, part: &Observed, residual: &Trace) -> Trace {
    let places: Vec<u32> = (0..whole.mask.num_voxels() as u32).collect();
    let place_of = whole.mask.spread(&places, u32::MAX);
    let is_in_part = |drive_mm: f64| part.steps.iter().any(|s| s.drive_mm.to_bits() == drive_mm.to_bits());
    let fields = residual.displacement.iter().zip(&whole.steps).filter(|(_, s)| is_in_part(s.drive_mm));
    let displacement = fields
        .map(|(field, _)| part.mask.voxels.iter().map(|&v| field[place_of[v as usize] as usize]).collect())
        .collect();
    Trace { displacement, force: vec![0.0; part.steps.len()] }
}
