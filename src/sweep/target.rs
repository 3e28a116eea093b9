//! What a variable sets: one number of the specimen, the material or the scan, by name.

use super::study_error::SweepStudyError;
use crate::material::{LawParameter, Material, Parameter};
use crate::sensitivity::ScanSettings;
use crate::specimen::{HoleShape, Specimen};

/// A place that a variable's value goes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Target {
    place: Place,
    /// The value is negated: holes that move apart.
    is_negated: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// The only drive of the specimen.
    Drive,
    Length,
    Thickness,
    Width,
    Wedge,
    Precompression,
    GaugeWidth,
    GaugeLength,
    FilletRadius,
    HoleX(usize),
    HoleOther(usize),
    HoleDiameter(usize),
    HoleLength(usize),
    HoleAngle(usize),
    Bulk,
    Mu(usize),
    Alpha(usize),
    Law(LawParameter),
    Voxel(usize),
    Noise(usize),
    ForceSd,
}

impl Target {
    /// Reads `drive_mm`, `precompression_mm`, `block.length_mm`, `block.thickness_mm`, `block.width_mm`,
    /// `block.wedge_mm`, `outline.dumbbell.gauge_width_mm`,
    /// `outline.dumbbell.gauge_length_mm`, `outline.dumbbell.fillet_radius_mm`, `holes[i].x_mm`,
    /// `holes[i].other_mm` (z of a hole along the thickness, y of one along the width), `holes[i].diameter_mm`,
    /// `holes[i].length_mm` and `holes[i].angle_deg` (of a hole with an outline of its own), `material.bulk_kpa`,
    /// `material.mu_1_kpa`, `material.alpha_1` (of a law `material.c_1_kpa`, `material.mu_kpa`, `material.j_m`,
    /// `material.lambda_m`), `scan.voxel_mm[c]`, `scan.noise_sd_mm[c]` or `scan.force_sd_n`; indices
    /// of holes and components from 0, of Ogden terms from 1. A leading `-` sets the negated value.
    ///
    /// # Errors
    /// [`SweepStudyError::UnknownTarget`].
    pub fn parse(variable: &str, text: &str) -> Result<Target, SweepStudyError> {
        let (is_negated, name) = text.strip_prefix('-').map_or((false, text), |rest| (true, rest));
        let unknown = || SweepStudyError::UnknownTarget { variable: variable.into(), target: text.into() };
        let place = match name {
            "drive_mm" => Place::Drive,
            "precompression_mm" => Place::Precompression,
            "block.length_mm" => Place::Length,
            "block.thickness_mm" => Place::Thickness,
            "block.width_mm" => Place::Width,
            "block.wedge_mm" => Place::Wedge,
            "outline.dumbbell.gauge_width_mm" => Place::GaugeWidth,
            "outline.dumbbell.gauge_length_mm" => Place::GaugeLength,
            "outline.dumbbell.fillet_radius_mm" => Place::FilletRadius,
            "material.bulk_kpa" => Place::Bulk,
            "scan.force_sd_n" => Place::ForceSd,
            "material.mu_kpa" => Place::Law(LawParameter::Modulus),
            "material.j_m" => Place::Law(LawParameter::Limit),
            "material.lambda_m" => Place::Law(LawParameter::LockingStretch),
            other => Self::indexed(other).ok_or_else(unknown)?,
        };
        Ok(Target { place, is_negated })
    }

    fn indexed(name: &str) -> Option<Place> {
        if let Some(rest) = name.strip_prefix("holes[") {
            let (index, field) = rest.split_once("].")?;
            let index = index.parse().ok()?;
            return match field {
                "x_mm" => Some(Place::HoleX(index)),
                "other_mm" => Some(Place::HoleOther(index)),
                "diameter_mm" => Some(Place::HoleDiameter(index)),
                "length_mm" => Some(Place::HoleLength(index)),
                "angle_deg" => Some(Place::HoleAngle(index)),
                _ => None,
            };
        }
        let component = |prefix: &str| -> Option<usize> {
            let index = name.strip_prefix(prefix)?.strip_suffix(']')?.parse().ok()?;
            (index < 3).then_some(index)
        };
        if let Some(c) = component("scan.voxel_mm[") {
            return Some(Place::Voxel(c));
        }
        if let Some(c) = component("scan.noise_sd_mm[") {
            return Some(Place::Noise(c));
        }
        let term = |text: &str| -> Option<usize> { text.parse::<usize>().ok()?.checked_sub(1) };
        if let Some(number) = name.strip_prefix("material.mu_") {
            return Some(Place::Mu(term(number.strip_suffix("_kpa")?)?));
        }
        if let Some(number) = name.strip_prefix("material.c_") {
            return Some(Place::Law(LawParameter::Coefficient(term(number.strip_suffix("_kpa")?)?)));
        }
        Some(Place::Alpha(term(name.strip_prefix("material.alpha_")?)?))
    }

    /// Unit suffix that the variable's name must end in, so that its column says its unit; none for a pure number.
    pub fn unit_suffix(&self) -> &'static str {
        match self.place {
            Place::Bulk | Place::Mu(_) => "_kpa",
            Place::Alpha(_) => "",
            Place::Law(parameter) if parameter.is_modulus() => "_kpa",
            Place::Law(_) => "",
            Place::ForceSd => "_n",
            Place::HoleAngle(_) => "_deg",
            _ => "_mm",
        }
    }

    /// Whether the value goes to the same number as that of `other`, with the same sign or not.
    pub fn is_same_place(&self, other: &Target) -> bool {
        self.place == other.place
    }

    /// Whether the value goes to the scan, whose numbers are all above 0.
    pub(super) fn is_of_scan(&self) -> bool {
        matches!(self.place, Place::Voxel(_) | Place::Noise(_) | Place::ForceSd)
    }

    /// What is set where the variable has `value`.
    pub(super) fn signed(&self, value: f64) -> f64 {
        if self.is_negated { -value } else { value }
    }

    /// Sets `value`; false where there is no such hole, outline, gauge or term.
    pub fn set(&self, value: f64, specimen: &mut Specimen, material: &mut Material, scan: &mut ScanSettings) -> bool {
        let value = self.signed(value);
        let slot = match self.place {
            Place::Drive => {
                specimen.drive_mm = vec![value];
                return true;
            }
            Place::Law(parameter) => {
                let has_it = material.parameters().contains(&Parameter::Law(parameter));
                material.set(Parameter::Law(parameter), value);
                return has_it;
            }
            Place::Precompression => Some(&mut specimen.precompression_mm),
            Place::Length => Some(&mut specimen.block.length_mm),
            Place::Thickness => Some(&mut specimen.block.thickness_mm),
            Place::Width => Some(&mut specimen.block.width_mm),
            Place::Wedge => Some(&mut specimen.block.wedge_mm),
            Place::GaugeWidth => specimen.outline.free_gauge_mut().map(|gauge| &mut gauge.gauge_width_mm),
            Place::GaugeLength => specimen.outline.free_gauge_mut().map(|gauge| &mut gauge.gauge_length_mm),
            Place::FilletRadius => specimen.outline.free_gauge_mut().map(|gauge| &mut gauge.fillet_radius_mm),
            Place::HoleX(i) => specimen.holes.get_mut(i).map(|h| &mut h.center_mm[0]),
            Place::HoleOther(i) => specimen.holes.get_mut(i).map(|h| &mut h.center_mm[1]),
            Place::HoleDiameter(i) => specimen.holes.get_mut(i).map(|h| &mut h.diameter_mm),
            Place::HoleLength(i) => shape_of(specimen, i).map(|shape| &mut shape.length_mm),
            Place::HoleAngle(i) => shape_of(specimen, i).map(|shape| &mut shape.angle_deg),
            Place::Bulk => Some(&mut material.bulk_kpa),
            Place::Mu(i) => material.terms.get_mut(i).map(|t| &mut t.mu_kpa),
            Place::Alpha(i) => material.terms.get_mut(i).map(|t| &mut t.alpha),
            Place::Voxel(c) => scan.voxel_mm.get_mut(c),
            Place::Noise(c) => scan.noise_sd_mm.get_mut(c),
            Place::ForceSd => Some(&mut scan.force_sd_n),
        };
        slot.is_some_and(|slot| {
            *slot = value;
            true
        })
    }
}

/// The outline of a hole that is not a circle.
fn shape_of(specimen: &mut Specimen, hole: usize) -> Option<&mut HoleShape> {
    specimen.holes.get_mut(hole)?.shape.as_mut()
}
