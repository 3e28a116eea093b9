//! Pictures of a scan: slices of its phases, magnitude and displacements.

use super::{ColorMap, VoxelField, VoxelMaps};
use crate::recording::{RawRecording, Recording};
use std::f64::consts::PI;

/// Names of the axes.
const AXES: [&str; 3] = ["x", "y", "z"];

/// Slices of the three wrapped phases and of the magnitude of one step (index from 0), all voxels of the grid.
pub fn raw_picture(raw: &RawRecording, step: usize) -> String {
    let Some(step) = raw.steps.get(step) else {
        return VoxelMaps::default().to_svg();
    };
    let mut fields: Vec<VoxelField> = (0..3)
        .map(|a| VoxelField {
            title: format!("phase along {}, drive {:.2} mm", AXES[a], step.drive_mm),
            unit: "rad".into(),
            values: step.phase[a].clone(),
            map: ColorMap::Diverging,
            range: Some([-PI, PI]),
        })
        .collect();
    fields.push(VoxelField {
        title: "magnitude".into(),
        unit: String::new(),
        values: step.magnitude.clone(),
        map: ColorMap::Magma,
        range: None,
    });
    let grid = &raw.grid;
    VoxelMaps { shape: grid.shape, origin_mm: grid.origin_mm, voxel_mm: grid.voxel_mm, fields }.slices_to_svg()
}

/// Slices of the displacements of one step (index from 0) that are measured, and of how many of them are there. Of a
/// face there is one slice, the face itself.
pub fn displacement_picture(recording: &Recording, step: usize) -> String {
    let Some(step) = recording.steps.get(step) else {
        return VoxelMaps::default().to_svg();
    };
    let grid = &recording.grid;
    let measured: Vec<usize> = (0..3).filter(|&a| grid.measured()[a]).collect();
    let mut fields: Vec<VoxelField> = measured
        .iter()
        .map(|&a| VoxelField {
            title: format!("u along {}, drive {:.2} mm", AXES[a], step.drive_mm),
            unit: "mm".into(),
            values: step.displacement.iter().map(|u| u[a]).collect(),
            map: ColorMap::Viridis,
            range: None,
        })
        .collect();
    let present = |(is_in, u): (&bool, &[f64; 3])| {
        if *is_in { u.iter().filter(|x| x.is_finite()).count() as f64 } else { f64::NAN }
    };
    fields.push(VoxelField {
        title: format!("components known (of {})", if measured.len() == 3 { "three" } else { "two" }),
        unit: String::new(),
        values: recording.mask.iter().zip(&step.displacement).map(present).collect(),
        map: ColorMap::Magma,
        range: Some([0.0, measured.len() as f64]),
    });
    VoxelMaps { shape: grid.shape, origin_mm: grid.origin_mm, voxel_mm: grid.voxel_mm, fields }.slices_to_svg()
}

#[cfg(test)]
mod tests {
    use super::super::test_xml::assert_well_formed;
    use super::*;
    use crate::recording::{Filter, RawStep, RecordedStep};
    use crate::specimen::Specimen;
    use crate::voxel::VoxelGrid;

    #[test]
    fn pictures_are_well_formed() {
        let specimen = Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).unwrap();
        let grid = VoxelGrid::new([0.0; 3], [1.0; 3], [3, 4, 2]).unwrap();
        let numbers: Vec<f64> = (0..24).map(|v| 0.1 * f64::from(v) - 1.0).collect();
        let raw = RawRecording {
            id: "a".into(),
            specimen: specimen.clone(),
            grid: grid.clone(),
            mask: vec![true; 24],
            steps: vec![RawStep {
                drive_mm: 1.0,
                force_n: None,
                force_sd_n: None,
                window_s: None,
                phase: [numbers.clone(), numbers.clone(), numbers.clone()],
                magnitude: numbers.iter().map(|x| x.abs()).collect(),
                mm_per_radian: [0.1; 3],
            }],
            noise_sd_mm: None,
            load: None,
            notes: None,
        };
        let svg = raw_picture(&raw, 0);
        assert_well_formed(&svg);
        assert!(svg.contains("phase along z") && !svg.contains("mean over"));
        assert_well_formed(&raw_picture(&raw, 7));
        let mut displacement: Vec<[f64; 3]> = numbers.iter().map(|x| [*x; 3]).collect();
        displacement[5][1] = f64::NAN;
        let recording = Recording {
            id: "a".into(),
            specimen,
            grid,
            mask: vec![true; 24],
            steps: vec![RecordedStep { drive_mm: 1.0, force_n: None, force_sd_n: None, window_s: None, displacement }],
            noise_sd_mm: None,
            filter: Filter::None,
            load: None,
            notes: None,
        };
        assert_well_formed(&displacement_picture(&recording, 0));
    }
}
