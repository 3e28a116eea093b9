//! A recording's voxels, or the subsets of the face that cameras saw, as tables of points: what `import` reads again.

use crate::recording::{RecordedStep, Recording};
use std::fmt::Write;

/// The points of a step: `x_mm,y_mm,z_mm`, the displacements that are measured (`ux_mm`, …) and, where one number says
/// it of all of them, the standard deviation of a component (`sd_mm`). A point in the sample without a displacement has
/// `nan`.
pub fn recording_points(recording: &Recording, step: &RecordedStep) -> String {
    let grid = &recording.grid;
    let components: Vec<usize> = (0..3).filter(|&a| grid.measured()[a]).collect();
    let sd = recording.noise_sd_mm.and_then(|sd| {
        let first = sd[components[0]];
        let is_one = components.iter().all(|&a| (sd[a] - first).abs() <= 1e-12 * first);
        is_one.then_some(first)
    });
    let mut text = String::from("x_mm,y_mm,z_mm");
    components.iter().for_each(|&a| text += [",ux_mm", ",uy_mm", ",uz_mm"][a]);
    text += if sd.is_some() { ",sd_mm\n" } else { "\n" };
    for voxel in (0..grid.num_voxels()).filter(|&v| recording.mask[v]) {
        let [x, y, z] = grid.center_mm(voxel);
        let u = step.displacement[voxel];
        let mut line = format!("{x},{y},{z}");
        for &a in &components {
            // Writing to a text does not fail.
            let _ = if u[a].is_finite() { write!(line, ",{}", u[a]) } else { write!(line, ",nan") };
        }
        if let Some(sd) = sd {
            let _ = write!(line, ",{sd}");
        }
        text += &line;
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::MemoryLimit;
    use crate::recording::{DisplacementPoint, ImportOptions, read_points, recording_from_points};
    use crate::specimen::Specimen;
    use crate::voxel::{Face, MeasuredComponents, Surface};
    use std::path::Path;

    fn specimen() -> Specimen {
        let specimen = Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).unwrap();
        Specimen { holes: vec![], drive_mm: vec![5.0], ..specimen }
    }

    /// Points on planes, of a volume or of a face, with one that is missing and one that has no displacement, are
    /// imported, written and imported again: grid, mask and displacements are the same.
    #[test]
    fn points_come_back() {
        let of_face = |components| Some(Surface { face: Face::PlusZ, components });
        for surface in [None, of_face(MeasuredComponents::All), of_face(MeasuredComponents::InPlane)] {
            let memory = MemoryLimit::body(1 << 26).begin();
            let specimen = specimen();
            let layers = if surface.is_some() { 1 } else { 4 };
            let mut points = Vec::new();
            for (i, j, k) in (0..10).flat_map(|i| (0..8).flat_map(move |j| (0..layers).map(move |k| (i, j, k)))) {
                let top = if surface.is_some() { Face::PlusZ.position_mm(&specimen) } else { 7.1625 };
                let y = -2.8 + 0.8 * f64::from(j);
                let position = [-11.43 + 2.54 * f64::from(i), y, top - 4.775 * f64::from(k)];
                let mut displacement = [0.7 * y, 0.5 + 0.01 * f64::from(i), 0.25 - 0.02 * f64::from(k)];
                match (i, j, k) {
                    (1, 1, 0) => continue,
                    (2, 3, 0) => displacement = [f64::NAN; 3],
                    _ => {}
                }
                points.push(DisplacementPoint { position, displacement, weight: 1.0, sd: Some(0.03) });
            }
            let made = |points: Vec<DisplacementPoint>| {
                recording_from_points(&[points], &specimen, None, surface, &ImportOptions::default(), &memory).unwrap()
            };
            let first = made(points);
            let text = recording_points(&first, &first.steps[0]);
            let is_flat = matches!(surface, Some(Surface { components: MeasuredComponents::InPlane, .. }));
            assert_eq!(text.lines().next().unwrap().contains("uz_mm"), !is_flat, "{text}");
            let second = made(read_points(&text, Path::new("again.csv"), surface, 1.0, &memory).unwrap().points);
            assert_eq!((&first.mask, first.grid.shape), (&second.mask, second.grid.shape));
            for a in 0..3 {
                // Spacings of planes are differences of the positions.
                assert!((first.grid.voxel_mm[a] - second.grid.voxel_mm[a]).abs() < 1e-12);
                assert!((first.grid.origin_mm[a] - second.grid.origin_mm[a]).abs() < 1e-12);
            }
            let [before, after] = [&first, &second].map(|r| r.noise_sd_mm.unwrap());
            // Where nothing is measured the noise has no bound.
            assert!(before.iter().zip(after).all(|(a, b)| *a == b || (a - b).abs() < 1e-12));
            let pairs = first.steps[0].displacement.iter().flatten().zip(second.steps[0].displacement.iter().flatten());
            for (a, b) in pairs {
                assert!(a == b || (a.is_nan() && b.is_nan()), "{a} {b}");
            }
        }
    }
}
