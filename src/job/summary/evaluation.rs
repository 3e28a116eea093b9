//! An evaluation as text.

use crate::sensitivity::Evaluation;

/// The evaluation as text.
pub(in crate::job) fn evaluation(name: &str, evaluation: &Evaluation) -> String {
    let mut text = format!("{name}\n");
    for step in &evaluation.steps {
        text += &format!(
            "\ndrive {} mm: force {:.3} N, {} voxels, median stretch {:.3}, largest {:.3}\n",
            step.drive_mm, step.force_n, step.num_voxels, step.median_stretch, step.largest_voxel_stretch
        );
        text += "  parameter   integrated sensitivity: sum   mean per voxel   volume integral (mm³)\n";
        for s in &step.integrated_sensitivity {
            text += &format!(
                "  {:<10} {:>29.1} {:>16.4} {:>23.1}\n",
                s.parameter, s.sum, s.mean_per_voxel, s.volume_integral
            );
        }
    }
    for step in &evaluation.force_steps {
        text += &format!("\ndrive {} mm: force {:.3} N, read without a scan\n", step.drive_mm, step.force_n);
    }
    text += "\npromised standard deviations, all drives together\n";
    for p in &evaluation.promised_sd {
        text += &match (p.value, p.relative_sd) {
            (Some(sd), Some(relative)) => format!(
                "  {:<10} {:>12.4} ({:.2} %){}\n",
                p.parameter,
                sd,
                100.0 * relative,
                if p.identifiable { "" } else { "  not identifiable" }
            ),
            _ => format!("  {:<10} not determined by these data\n", p.parameter),
        };
    }
    text
}
