//! Scans and imports as text.

use super::num;
use crate::acquisition::{ScanResult, SettingsOfScan};
use crate::job::import_result::ImportResult;
use crate::voxel::MeasuredComponents;

/// One number per component; a dash where it is not measured.
fn per_component(sd: [Option<f64>; 3]) -> String {
    sd.map(|sd| sd.map_or_else(|| "-".into(), |sd| num(sd, 5))).join(", ")
}

pub(in crate::job) fn scan(name: &str, result: &ScanResult) -> String {
    let mut text = format!("{name}: {} voxels, seed {}\n", result.num_voxels, result.seed);
    let list = |sd: [f64; 3]| sd.map(|x| num(x, 5)).join(", ");
    if let Some(sd) = result.noise_at_full_signal_mm {
        text += &format!("noise at full signal (x, y, z): {} mm\n", list(sd));
    }
    let is_of_cameras = matches!(result.options, SettingsOfScan::Cameras(_));
    if let Some(sd) = result.noise_sd_mm {
        let how = if is_of_cameras { "as told" } else { "estimated" };
        text += &format!("noise of the displacements, {how}: {} mm\n", per_component(sd));
    }
    if is_of_cameras {
        text += "\n  drive mm   force N   true N\n";
        for step in &result.steps {
            let force = step.force_n.map_or("-".into(), |f| num(f, 5));
            text += &format!("{:>10} {force:>9} {:>8}\n", num(step.drive_mm, 5), num(step.true_force_n, 5));
        }
        return text;
    }
    text += "\n  drive mm   force N   true N   axis    kept  low signal  disputed  inconsistent  unconnected   rms error mm\n";
    for step in &result.steps {
        let force = step.force_n.map_or("-".into(), |f| num(f, 5));
        text += &format!("{:>10} {force:>9} {:>8}", num(step.drive_mm, 5), num(step.true_force_n, 5));
        match (&step.reconstruction, &step.error) {
            (Some(report), Some(errors)) => {
                for (a, (c, e)) in report.components.iter().zip(errors).enumerate() {
                    if a > 0 {
                        text += &" ".repeat(29);
                    }
                    text += &format!(
                        "   {:<4} {:>7} {:>11} {:>9} {:>13} {:>12} {:>14}{}{}\n",
                        ["x", "y", "z"][a],
                        c.num_kept,
                        c.num_low_signal,
                        c.num_disputed,
                        c.num_inconsistent,
                        c.num_unconnected,
                        num(e.rms_mm, 6),
                        if e.num_wrong_turns > 0 {
                            format!("  {} a turn off", e.num_wrong_turns)
                        } else {
                            String::new()
                        },
                        if c.anchor.is_ambiguous { "  whole turns uncertain" } else { "" }
                    );
                }
            }
            _ => text += "   raw phases\n",
        }
    }
    text
}

pub(in crate::job) fn import(result: &ImportResult) -> String {
    let mut text = format!("{}: {} voxels in the mask\n", result.id, result.num_voxels);
    if let Some(sd) = result.noise_sd_mm {
        text += &format!("noise (x, y, z): {} mm\n", per_component(sd));
    }
    if !result.left_aside.is_empty() {
        let listed = result.left_aside.join(", ");
        text += &format!("left aside, for no name of the format is so: {listed}\n");
    }
    for step in &result.steps {
        let what = match (result.is_raw, result.surface.map(|s| s.components)) {
            (true, _) => "raw phases",
            (false, Some(MeasuredComponents::InPlane)) => "both components in the plane of the face",
            (false, _) => "all three components",
        };
        let force = step.force_n.map_or(String::new(), |f| format!("; force {} N", num(f, 5)));
        text += &format!("\ndrive {} mm: {} voxels with {what}{force}\n", step.drive_mm, step.num_complete);
        let Some(report) = &step.reconstruction else { continue };
        for (axis, c) in ["x", "y", "z"].iter().zip(&report.components) {
            text += &format!(
                "  {axis}: kept {} of {}; low signal {}, disputed {}, inconsistent {}, unconnected {}; sd {} mm",
                c.num_kept,
                c.num_voxels,
                c.num_low_signal,
                c.num_disputed,
                c.num_inconsistent,
                c.num_unconnected,
                num(c.median_sd_mm, 5)
            );
            let show = |u: Option<f64>| u.map_or("not seen".into(), |u| format!("{} mm", num(u, 4)));
            text += &format!(
                "; fixed plate {}, moved plate {}\n",
                show(c.anchor.fixed_plate_mm),
                show(c.anchor.moved_plate_mm)
            );
            if c.anchor.is_ambiguous {
                text += "     the whole turns are not certain: the fixed plate should be at zero (see --anchor)\n";
            }
        }
    }
    text
}
