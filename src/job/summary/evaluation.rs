//! An evaluation as text.

use super::num;
use crate::sensitivity::Evaluation;

/// The evaluation as text.
pub(in crate::job) fn evaluation(name: &str, evaluation: &Evaluation) -> String {
    let mut text = format!("{name}\n");
    for step in &evaluation.steps {
        text += &format!(
            "\ndrive {} mm: force {} N, {} voxels, median stretch {}, largest {}\n",
            step.drive_mm,
            num(step.force_n, 4),
            step.num_voxels,
            num(step.median_stretch, 4),
            num(step.largest_voxel_stretch, 4)
        );
        text += "  parameter   integrated sensitivity: sum   mean per voxel   volume integral (mm³)\n";
        for s in &step.integrated_sensitivity {
            text += &format!(
                "  {:<10} {:>29} {:>16} {:>23}\n",
                s.parameter,
                num(s.sum, 4),
                num(s.mean_per_voxel, 5),
                num(s.volume_integral, 4)
            );
        }
    }
    for step in &evaluation.force_steps {
        text += &format!("\ndrive {} mm: force {} N, read without a scan\n", step.drive_mm, num(step.force_n, 4));
    }
    text += "\npromised standard deviations, all drives together\n";
    for p in &evaluation.promised_sd {
        text += &match (p.value, p.relative_sd) {
            (Some(sd), Some(relative)) => format!(
                "  {:<10} {:>12} ({} %){}\n",
                p.parameter,
                num(sd, 5),
                num(100.0 * relative, 4),
                if p.identifiable { "" } else { "  not identifiable" }
            ),
            _ => format!("  {:<10} not determined by these data\n", p.parameter),
        };
    }
    text
}
