//! What a diagnosis should have found.

use super::draw::{Hidden, HiddenCause};
use crate::specimen::Specimen;

/// True values of those parameters of the diagnosis that mean the same as the hidden cause's own.
pub(super) fn truths(specimen: &Specimen, h: &Hidden) -> Vec<(String, f64)> {
    let axis = |n: usize| ["x", "y", "z"][n];
    // The drawn axis has the strength, the others have none.
    let along = |name: &str, axes: &[usize]| -> Vec<(String, f64)> {
        axes.iter().map(|&a| (format!("{name}{}", axis(a)), if a == h.which { h.strength } else { 0.0 })).collect()
    };
    let strength_of = |name: &str| vec![(name.to_string(), h.strength)];
    match h.cause {
        HiddenCause::Gradient => along("relative_change_center_to_face_", &[0, 1, 2]),
        HiddenCause::Inclusion => {
            let mut all = strength_of("log_stiffness_factor");
            all.extend((0..3).map(|a| (format!("center_{}_mm", axis(a)), h.center_mm[a])));
            all.push(("radius_mm".into(), 0.5 * h.extent_mm[0]));
            all
        }
        HiddenCause::Swelling => strength_of("log_volume_ratio"),
        HiddenCause::Debond => {
            let half = [0.5 * specimen.block.length_mm, 0.0, 0.5 * specimen.block.width_mm];
            // Edges on the face's own boundary are no parameters.
            [0, 2]
                .into_iter()
                .flat_map(|a| {
                    let edges = [-0.5, 0.5].map(|s| h.center_mm[a] + s * h.extent_mm[a]);
                    [("low", edges[0]), ("high", edges[1])].map(|(n, e)| (format!("{n}_{}_mm", axis(a)), e, half[a]))
                })
                .filter(|(_, edge, half)| edge.abs() < half - 0.3)
                .map(|(name, edge, _)| (name, edge))
                .collect()
        }
        HiddenCause::Tilt => along("degrees_at_full_drive_about_", &[0, 1, 2]),
        HiddenCause::Offaxis => [1, 2]
            .map(|a| (format!("{}_mm_at_full_drive", axis(a)), if a == h.which { h.strength } else { 0.0 }))
            .to_vec(),
        HiddenCause::Compliance => strength_of("mm_per_n"),
        HiddenCause::Cell => strength_of("offset_n"),
        HiddenCause::Gain => along("relative_gain_error_", &[0, 1, 2]),
        HiddenCause::Hole => ["diameter_error_mm", "center_error_x_mm", "center_error_z_mm"]
            .into_iter()
            .zip(h.direction)
            .map(|(name, d)| (name.to_string(), h.strength * d))
            .collect(),
        HiddenCause::Fibre => {
            vec![("modulus_kpa".into(), h.strength * h.material.initial_shear_modulus_kpa())]
        }
        HiddenCause::Wrap => strength_of("jump_mm"),
        HiddenCause::Registration => {
            (0..3).map(|a| (format!("shift_{}_mm", axis(a)), if a == h.which { h.strength } else { 0.0 })).collect()
        }
        HiddenCause::Slack => strength_of("slack_mm"),
        HiddenCause::Mount => ["y_mm", "z_mm", "degrees_about_x", "degrees_about_y", "degrees_about_z"]
            .into_iter()
            .enumerate()
            .map(|(n, name)| (name.to_string(), if n == h.which { h.strength } else { 0.0 }))
            .collect(),
        // A firm bond has no true value: it is the end of the parameter's range.
        HiddenCause::Bond => [(0, "fixed"), (1, "moved")]
            .into_iter()
            .filter(|(face, _)| h.which == *face || h.which == 2)
            .map(|(_, name)| (format!("{name}_plate_mm_per_kpa"), h.strength))
            .collect(),
        HiddenCause::Compressibility => strength_of("bulk_over_shear_modulus"),
        _ => Vec::new(),
    }
}
