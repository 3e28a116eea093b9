//! An evaluation as text.

use super::num;
use crate::report::{telling, which_of};
use crate::sensitivity::{DetectableSize, Evaluation, PromisedSd};
use crate::specimen::way_across_plates;

/// The evaluation as text.
pub(in crate::job) fn evaluation(name: &str, evaluation: &Evaluation) -> String {
    let mut text = format!("{name}\n");
    // What is seen, its extent and the unit of it.
    let (seen, integral) = match evaluation.scan.surface {
        Some(surface) => {
            text += &format!("cameras at the face {}\n", surface.face.name());
            ("subsets", "surface integral (mm²)")
        }
        None => ("voxels", "volume integral (mm³)"),
    };
    if evaluation.blocks_scanned > 1 {
        text += &format!("{} blocks scanned together\n", evaluation.blocks_scanned);
    }
    for (index, step) in evaluation.steps.iter().enumerate() {
        text += &format!(
            "\ndrive {} mm: force {} N{}, {} {seen}, median stretch {}, largest {}\n",
            step.drive_mm,
            num(step.force_n, 4),
            step.force_discretisation_n.map_or_else(String::new, |bound| format!(" (mesh ± {} N)", num(bound, 2))),
            step.num_voxels,
            num(step.median_stretch, 4),
            num(step.largest_voxel_stretch, 4)
        );
        if let Some(loss) = step.phase_loss {
            let [x, y, z] = loss.mean_signal.map(|part| num(part, 3));
            text += &format!(
                "  phases: {} voxels cannot be unwrapped; the others keep {x}, {y} and {z} of their signal along x, y and z\n",
                loss.num_voxels_lost
            );
        }
        if let Some(share) = evaluation.scan_share.get(index) {
            text += &format!("  scanned in {} % of the time of one scan\n", num(100.0 * share, 3));
        }
        if !step.force_by_kind_n.is_empty() {
            let forces: Vec<String> = step.force_by_kind_n.iter().map(|f| num(*f, 4)).collect();
            text += &format!("  of this each kind of sample: {} N\n", forces.join(", "));
        }
        if let Some(force_n) = step.normal_force_n {
            let way = way_across_plates(force_n);
            text += &format!("  force across the plates: {} N, which {way}\n", num(force_n.abs(), 4));
        }
        let is_bounded = step.integrated_sensitivity.iter().any(|s| s.discretisation_relative.is_some());
        let mesh = if is_bounded { "   mesh" } else { "" };
        text += &format!("  parameter   integrated sensitivity: sum   mean per voxel  {integral:>22}{mesh}\n");
        for s in &step.integrated_sensitivity {
            text += &format!(
                "  {:<10} {:>29} {:>16} {:>23}{}\n",
                s.parameter,
                num(s.sum, 4),
                num(s.mean_per_voxel, 5),
                num(s.surface_integral.unwrap_or(s.volume_integral), 4),
                s.discretisation_relative.map_or_else(String::new, |bound| format!("   {}", within(bound)))
            );
        }
    }
    for step in &evaluation.force_steps {
        text += &format!("\ndrive {} mm: force {} N, read without a scan\n", step.drive_mm, num(step.force_n, 4));
    }
    text += "\npromised standard deviations, all drives together\n";
    text += &promised(&evaluation.promised_sd);
    if let Some(best) = &evaluation.best_scan_share {
        let shares: Vec<String> = best.scan_share.iter().map(|s| format!("{:.1} %", 100.0 * s)).collect();
        text += &format!("\nbest shares of the scan's time: {}; they promise\n", shares.join(", "));
        text += &promised(&best.promised_sd);
    }
    if !evaluation.detectable.is_empty() {
        text += "\nerrors that a diagnosis would name with 90 % probability, from these sizes on\n";
        text += &detectable(&evaluation.detectable);
    }
    text
}

/// Sizes of errors, a line each; of a cause with many parameters the hardest alone.
fn detectable(sizes: &[DetectableSize]) -> String {
    let mut text = String::new();
    for (row, num_alike) in telling(sizes) {
        let name = format!("{}{}", row.cause, which_of(row));
        let size = row.size.map_or_else(|| "never".into(), |size| num(size, 3));
        let rival = row.rival.as_ref().map_or_else(String::new, |rival| format!(", {rival}"));
        let hardest = if num_alike > 1 { format!(" (hardest of {num_alike})") } else { String::new() };
        let limit = row.limited_by.words();
        text += &format!("  {name:<14} {size:>9}  {:<36} limited by {limit}{rival}{hardest}\n", row.parameter);
    }
    text
}

/// Standard deviations, a line each.
fn promised(list: &[PromisedSd]) -> String {
    let mut text = String::new();
    for p in list {
        text += &match (p.value, p.relative_sd) {
            (Some(sd), Some(relative)) => format!(
                "  {:<10} {:>12} ({} %{}){}\n",
                p.parameter,
                num(sd, 5),
                num(100.0 * relative, 4),
                p.discretisation_relative.map_or_else(String::new, |bound| format!("; mesh {}", within(bound))),
                if p.identifiable { "" } else { "  not identifiable" }
            ),
            _ => format!("  {:<10} not determined by these data\n", p.parameter),
        };
    }
    text
}

/// A bound of the mesh's error relative to the number that it stands behind.
fn within(bound: f64) -> String {
    format!("± {} %", num(100.0 * bound, 2))
}
