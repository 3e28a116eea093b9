//! A calibration as text.

use crate::calibration::CalibrationResult;

/// The result as text.
pub(in crate::job) fn calibration(result: &CalibrationResult) -> String {
    let mut text = format!("{}\n\nnumber of terms\n", result.recordings.join(", "));
    text +=
        "  terms        chi2  chi2/datum   loss x 1000   mu (kPa)   F        p(F)      BIC change  decrement x 1000\n";
    for r in &result.term_selection.rows {
        let number = |v: Option<f64>, decimals: usize| v.map_or("-".to_string(), |v| format!("{v:.decimals$}"));
        text += &format!(
            "  {:<5} {:>11.1} {:>11.4} {:>13.4} {:>10.3}   {:<8} {:<9} {:<11} {}\n",
            r.num_terms,
            r.chi2,
            r.chi2_per_datum,
            1e3 * r.paper_loss,
            r.initial_shear_modulus_kpa,
            number(r.f_value, 2),
            r.f_p_value.map_or("-".to_string(), |p| format!("{p:.1e}")),
            number(r.bic_change, 1),
            number(r.decrement.map(|d| 1e3 * d), 4),
        );
        for d in &r.degeneracies {
            text += &format!("        {d}\n");
        }
    }
    let s = &result.term_selection;
    text += &format!(
        "  BIC takes {}, the F-test {}, the decrement {}; taken: {} ({})\n",
        s.by_bic, s.by_f_test, s.by_decrement, s.chosen, s.decided_by
    );
    text += "\nparameter            value           sd      95 % interval              mesh    misfit\n";
    let end = |v: Option<f64>| v.map_or("open".to_string(), |v| format!("{v:.5}"));
    for p in &result.parameters {
        let interval = format!("{} to {}", end(p.interval_95[0]), end(p.interval_95[1]));
        text += &match (p.value, p.sd) {
            (Some(value), Some(sd)) => {
                format!(
                    "  {:<10} {value:>13.5} {sd:>12.5}      {interval:<25} {:>8.5} {:>8.5}\n",
                    p.name, p.mesh_error, p.possible_shift
                )
            }
            _ => format!("  {:<10} not identifiable               {interval}\n", p.name),
        };
    }
    for r in &result.ratios {
        text += &format!("  {:<12} {:>11.4} ± {}\n", r.name, r.value, r.sd.map_or("?".into(), |s| format!("{s:.4}")));
    }
    if let Some(shear) = &result.initial_shear_modulus_kpa {
        let interval = shear.interval_95.map_or("open".into(), |[a, b]| format!("{a:.4} to {b:.4}"));
        text += &format!("  initial shear modulus {:.4} kPa, 95 % interval {interval}\n", shear.value);
    }
    text += &format!(
        "\nchi2 per datum {:.4}; paper's loss {:.4e} = loss_u {:.4e} + {:e} loss_F {}\n",
        result.chi2_per_datum,
        result.objective.paper_loss,
        result.loss_u,
        result.objective.beta,
        result.loss_f.map_or("(no force)".into(), |l| format!("{l:.4e}"))
    );
    for s in &result.steps {
        text += &format!(
            "  {} {} mm: {} voxels, misfit x, y, z {:.4} {:.4} {:.4} mm{}\n",
            s.recording,
            s.drive_mm,
            s.num_voxels,
            s.rms_mm[0],
            s.rms_mm[1],
            s.rms_mm[2],
            match (s.force_n, s.model_force_n) {
                (Some(f), Some(m)) => format!(", force {f:.4} N, model {m:.4} N"),
                _ => String::new(),
            }
        );
    }
    for note in &result.notes {
        text += &format!("note: {note}\n");
    }
    text
}
