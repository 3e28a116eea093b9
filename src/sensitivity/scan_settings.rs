//! The scan of an experiment that is being planned: its grid and its noise.

use super::information::{LEAST_SD, MeasurementNoise};
#[cfg(feature = "schema")]
use crate::field::schema::{number_above, numbers, schema_type};
use crate::field::{FieldError, FieldPath};
use crate::specimen::Specimen;
use crate::voxel::{Surface, VoxelError, VoxelGrid, VoxelMask, unbounded_where_unmeasured};
use serde::{Deserialize, Serialize};

#[cfg(feature = "schema")]
schema_type! {
    /// Three lengths along x, y and z, mm, each above 0.
    PositiveTripleMm = numbers(number_above(0.0), 3..=3);
    /// Displacement per phase along x, y and z, mm/rad, each above 0.
    PositiveTriple = numbers(number_above(0.0), 3..=3);
    /// A standard deviation of the force, N.
    ForceSdN = number_above(0.0);
}

/// How much a partly filled voxel counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum PartialVoxels {
    /// As every voxel of the mask: `noise_sd_mm` is that of the values given, as in recordings.
    #[default]
    Uniform,
    /// By its signal: the phase noise of an image goes as 1/magnitude and the magnitude as the filled part, so the
    /// weight w is the filled part squared.
    Signal,
}

impl PartialVoxels {
    /// Weights w of the voxels of a mask.
    pub fn weights(self, mask: &VoxelMask) -> Vec<f64> {
        mask.material_fraction
            .iter()
            .map(|f| match self {
                PartialVoxels::Uniform => 1.0,
                PartialVoxels::Signal => f * f,
            })
            .collect()
    }
}

/// Where the grid of a scan lies relative to the sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum GridPlace {
    /// In its middle, as one scan whose grid is placed on the sample to a small part of a voxel.
    #[default]
    Centred,
    /// Anywhere: what is promised is the mean over all places, so that it does not hang on the rows of voxels that
    /// happen to come in at the free faces.
    Anywhere,
}

impl GridPlace {
    /// Whether it is what files mean that do not say it.
    pub fn is_default(&self) -> bool {
        *self == GridPlace::default()
    }
}

/// The voxels of a scan of one block.
#[derive(Clone, Debug)]
pub struct ScannedVoxels {
    /// Grid and mask.
    pub mask: VoxelMask,
    /// For how many voxels of one scan each of them stands on average: 1 where the grid is centred.
    pub voxels_each: f64,
    /// Weight of each voxel of the mask: its noise variance is that of the scan over the weight.
    pub weights: Vec<f64>,
}

/// The scan: grid and noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = ScanSchema))]
#[serde(deny_unknown_fields)]
pub struct ScanSettings {
    /// Edges of a voxel, mm. Where a surface is seen, the two in the face are those of a subset.
    #[cfg_attr(feature = "schema", schema(value_type = PositiveTripleMm))]
    pub voxel_mm: [f64; 3],
    /// Standard deviation of a voxel's displacement along x, y, z, mm. That of a component which cameras do not measure
    /// is not used.
    #[cfg_attr(feature = "schema", schema(value_type = PositiveTripleMm))]
    pub noise_sd_mm: [f64; 3],
    /// Standard deviation of the load cell's force (all samples together), N.
    #[cfg_attr(feature = "schema", schema(value_type = ForceSdN))]
    pub force_sd_n: f64,
    /// Weight of partly filled voxels.
    #[serde(default)]
    pub partial_voxels: PartialVoxels,
    /// Where the grid lies relative to the sample.
    #[serde(default, skip_serializing_if = "GridPlace::is_default")]
    pub grid: GridPlace,
    /// Displacement per phase of each direction, mm/rad, where the scan is one of phases: `noise_sd_mm` is then that of
    /// a voxel that is displaced evenly. Where the displacement changes within a voxel there is less signal and so
    /// much more noise, and a voxel whose phase cannot be told from its neighbours' does not count. Left out, all
    /// voxels have `noise_sd_mm`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = PositiveTriple, nullable = false))]
    pub mm_per_radian: Option<[f64; 3]>,
    /// The face whose displacements cameras measure (digital image correlation), in place of a scan of the volume.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(nullable = false))]
    pub surface: Option<Surface>,
}

impl Default for ScanSettings {
    /// The paper's voxels, 1 × 0.1875 × 0.75 mm; 0.05 mm and 0.02 N noise.
    fn default() -> Self {
        ScanSettings {
            voxel_mm: [1.0, 0.1875, 0.75],
            noise_sd_mm: [0.05; 3],
            force_sd_n: 0.02,
            partial_voxels: PartialVoxels::default(),
            grid: GridPlace::default(),
            mm_per_radian: None,
            surface: None,
        }
    }
}

impl ScanSettings {
    /// The noise alone: without bound in components that are not measured.
    pub fn noise(&self) -> MeasurementNoise {
        let measured = self.surface.map_or([true; 3], Surface::measured);
        let displacement_sd_mm = unbounded_where_unmeasured(measured, self.noise_sd_mm);
        MeasurementNoise { displacement_sd_mm, force_sd_n: self.force_sd_n }
    }

    /// Its voxels on a specimen of one block.
    ///
    /// # Errors
    /// As [`VoxelGrid::planned`] and [`VoxelMask::of_specimen`].
    pub fn voxels(&self, specimen: &Specimen) -> Result<ScannedVoxels, VoxelError> {
        let (grid, voxels_each) = match self.grid {
            GridPlace::Centred => (VoxelGrid::planned(specimen, self.voxel_mm, self.surface)?, 1.0),
            GridPlace::Anywhere => VoxelGrid::tiling(specimen, self.voxel_mm, self.surface)?,
        };
        let mask = VoxelMask::of_specimen(specimen, grid)?;
        let weights = self.partial_voxels.weights(&mask).into_iter().map(|w| voxels_each * w).collect();
        Ok(ScannedVoxels { mask, voxels_each, weights })
    }

    /// The error of work that takes the noise to be the same in all voxels, where the scan encodes displacement as a
    /// phase; `remedy` says what to do.
    ///
    /// # Errors
    /// A pointer to `mm_per_radian`.
    pub fn needs_even_noise(&self, remedy: &str) -> Result<(), FieldError> {
        let Some(scale) = self.mm_per_radian else { return Ok(()) };
        let allowed = "left out: the same noise in all voxels";
        Err(FieldError::new("/mm_per_radian", format!("{scale:?}"), allowed).remedy(remedy))
    }

    /// The same scanner in the same time with other voxels, and another displacement per phase where it has one: the
    /// signal of a voxel goes with its volume, and the noise in mm with the displacement per phase over the signal.
    pub fn with_voxels(&self, voxel_mm: [f64; 3], mm_per_radian: Option<[f64; 3]>) -> ScanSettings {
        let volume = |edges: [f64; 3]| edges.iter().product::<f64>();
        let of_signal = volume(self.voxel_mm) / volume(voxel_mm);
        let of_phase = |axis: usize| match (mm_per_radian, self.mm_per_radian) {
            (Some(own), Some(before)) => own[axis] / before[axis],
            _ => 1.0,
        };
        let noise_sd_mm = [0, 1, 2].map(|axis| self.noise_sd_mm[axis] * of_signal * of_phase(axis));
        ScanSettings { voxel_mm, noise_sd_mm, mm_per_radian, ..*self }
    }

    /// The error of work that only a scan of the volume can do, where a surface is seen; `remedy` says what to do.
    ///
    /// # Errors
    /// A pointer to `surface`.
    pub fn needs_volume(&self, remedy: &str) -> Result<(), FieldError> {
        let Some(surface) = self.surface else { return Ok(()) };
        Err(FieldError::new("/surface", surface.face.name(), "left out: a scan of the volume").remedy(remedy))
    }

    /// Every number that is not what it must be: edges of voxels and standard deviations are positive and finite.
    pub fn field_errors(&self) -> Vec<FieldError> {
        let mut errors = Vec::new();
        let mut check = |path: FieldPath, value: f64, least: f64| {
            if !(value > least && value.is_finite()) {
                errors.push(FieldError::new(path.pointer(), value, "a finite number above 0"));
            }
        };
        for (axis, edge) in self.voxel_mm.into_iter().enumerate() {
            check(FieldPath::of("voxel_mm").index(axis), edge, 0.0);
        }
        for (axis, sd) in self.noise_sd_mm.into_iter().enumerate() {
            check(FieldPath::of("noise_sd_mm").index(axis), sd, LEAST_SD);
        }
        check(FieldPath::of("force_sd_n"), self.force_sd_n, LEAST_SD);
        for (axis, scale) in self.mm_per_radian.into_iter().flatten().enumerate() {
            check(FieldPath::of("mm_per_radian").index(axis), scale, 0.0);
        }
        if self.surface.is_some() && self.mm_per_radian.is_some() {
            let error = FieldError::new("/mm_per_radian", "given", "left out where a surface is seen");
            errors.push(error.remedy("cameras see no phase"));
        }
        if self.surface.is_some() && self.partial_voxels == PartialVoxels::Signal {
            let error = FieldError::new("/partial_voxels", "signal", "uniform where a surface is seen");
            errors
                .push(error.remedy("the noise of a subset of a camera's picture does not follow the signal of a coil"));
        }
        errors
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_useless_number_is_told_with_its_pointer() {
        let scan = ScanSettings {
            voxel_mm: [0.0, 1.0, f64::NAN],
            noise_sd_mm: [0.05, -1.0, 0.05],
            force_sd_n: f64::INFINITY,
            ..ScanSettings::default()
        };
        let pointers: Vec<String> = scan.field_errors().into_iter().map(|e| e.pointer).collect();
        assert_eq!(pointers, ["/voxel_mm/0", "/voxel_mm/2", "/noise_sd_mm/1", "/force_sd_n"]);
        let fine = ScanSettings { voxel_mm: [1.0; 3], noise_sd_mm: [0.05; 3], force_sd_n: 0.02, ..scan };
        assert_eq!(fine.field_errors(), []);
    }

    /// By hand: eight times the volume is an eighth of the noise, twice the displacement per phase twice the noise.
    #[test]
    fn other_voxels_have_other_noise() {
        let scan = ScanSettings { mm_per_radian: Some([0.2, 0.3, 0.4]), ..ScanSettings::default() };
        let larger = scan.with_voxels([2.0, 0.375, 1.5], scan.mm_per_radian);
        // Rounding alone.
        larger.noise_sd_mm.iter().for_each(|sd| assert!((sd - 0.05 / 8.0).abs() < 1e-15));
        let weaker = scan.with_voxels(scan.voxel_mm, Some([0.4, 0.3, 0.2]));
        for (sd, expected) in weaker.noise_sd_mm.iter().zip([0.1, 0.05, 0.025]) {
            assert!((sd - expected).abs() < 1e-15);
        }
        assert_eq!(weaker.field_errors(), []);
        let bad = ScanSettings { mm_per_radian: Some([0.2, 0.0, 0.4]), ..scan };
        let pointers: Vec<String> = bad.field_errors().into_iter().map(|e| e.pointer).collect();
        assert_eq!(pointers, ["/mm_per_radian/1"]);
        assert_eq!(scan.needs_even_noise("").expect_err("phases").pointer, "/mm_per_radian");
        ScanSettings::default().needs_even_noise("").expect("no phases");
    }

    /// Settings without a surface are read and written as before; with one, the component along its normal is not
    /// measured by one camera.
    #[test]
    fn surfaces_stand_beside_the_voxels() {
        let text =
            r#"{"voxel_mm":[1.0,1.0,1.0],"noise_sd_mm":[0.1,0.2,0.3],"force_sd_n":0.02,"partial_voxels":"uniform"}"#;
        let volume: ScanSettings = serde_json::from_str(text).expect("settings of a volume");
        assert_eq!(serde_json::to_string(&volume).expect("JSON"), text);
        assert_eq!(volume.noise().displacement_sd_mm, [0.1, 0.2, 0.3]);
        volume.needs_volume("").expect("a volume");
        let text = text.replace("\"uniform\"}", "\"signal\",\"surface\":{\"face\":\"+y\"}}");
        let seen: ScanSettings = serde_json::from_str(&text).expect("settings of a surface");
        assert_eq!(seen.noise().displacement_sd_mm, [0.1, f64::INFINITY, 0.3]);
        assert_eq!(seen.needs_volume("").expect_err("a surface").pointer, "/surface");
        let pointers: Vec<String> = seen.field_errors().into_iter().map(|e| e.pointer).collect();
        assert_eq!(pointers, ["/partial_voxels"]);
    }
}
