//! A calibration as text.

use super::num;
use crate::calibration::CalibrationResult;

/// The result as text.
pub(in crate::job) fn calibration(result: &CalibrationResult) -> String {
    let mut text = format!("{}\n", result.recordings.join(", "));
    if result.material.law.is_none() {
        add_terms(&mut text, result);
    }
    add_estimates(&mut text, result);
    text
}

/// The fits with one term, two, …
fn add_terms(text: &mut String, result: &CalibrationResult) {
    *text += "\nnumber of terms\n";
    *text +=
        "  terms        chi2  chi2/datum   loss x 1000   mu (kPa)   F        p(F)      BIC change  decrement x 1000\n";
    for r in &result.term_selection.rows {
        let number = |v: Option<f64>, decimals: usize| v.map_or("-".to_string(), |v| num(v, decimals + 2));
        *text += &format!(
            "  {:<5} {:>11} {:>11} {:>13} {:>10}   {:<8} {:<9} {:<11} {}\n",
            r.num_terms,
            num(r.chi2, 7),
            num(r.chi2_per_datum, 5),
            num(1e3 * r.paper_loss, 5),
            num(r.initial_shear_modulus_kpa, 4),
            number(r.f_value, 2),
            r.f_p_value.map_or("-".to_string(), |p| num(p, 2)),
            number(r.bic_change, 3),
            number(r.decrement.map(|d| 1e3 * d), 4)
        );
        for d in &r.degeneracies {
            *text += &format!("        {d}\n");
        }
    }
    let s = &result.term_selection;
    *text += &format!(
        "  BIC takes {}, the F-test {}, the decrement {}; taken: {} ({})\n",
        s.by_bic, s.by_f_test, s.by_decrement, s.chosen, s.decided_by
    );
}

/// The parameters and what goes with them.
fn add_estimates(text: &mut String, result: &CalibrationResult) {
    *text += "\nparameter            value           sd      95 % interval              mesh    misfit\n";
    let end = |v: Option<f64>| v.map_or("open".to_string(), |v| num(v, 6));
    for p in &result.parameters {
        let interval = format!("{} to {}", end(p.interval_95[0]), end(p.interval_95[1]));
        *text += &match (p.value, p.sd) {
            (Some(value), Some(sd)) => {
                format!(
                    "  {:<10} {:>13} {:>12}      {interval:<25} {:>8} {:>8}\n",
                    p.name,
                    num(value, 6),
                    num(sd, 6),
                    num(p.mesh_error, 6),
                    num(p.possible_shift, 6)
                )
            }
            _ => format!("  {:<10} not identifiable               {interval}\n", p.name),
        };
    }
    for r in &result.ratios {
        *text += &format!("  {:<12} {:>11} ± {}\n", r.name, num(r.value, 5), r.sd.map_or("?".into(), |s| num(s, 5)));
    }
    if let Some(shear) = &result.initial_shear_modulus_kpa {
        let interval = shear.interval_95.map_or("open".into(), |[a, b]| format!("{} to {}", num(a, 5), num(b, 5)));
        *text += &format!("  initial shear modulus {} kPa, 95 % interval {interval}\n", num(shear.value, 5));
    }
    *text += &format!(
        "\nchi2 per datum {}; paper's loss {} = loss_u {} + {:e} loss_F {}\n",
        num(result.chi2_per_datum, 5),
        num(result.objective.paper_loss, 5),
        num(result.loss_u, 5),
        result.objective.beta,
        result.loss_f.map_or("(no force)".into(), |l| num(l, 5))
    );
    let of_component = |mm: Option<f64>| mm.map_or_else(|| "-".into(), |mm| num(mm, 5));
    for s in &result.steps {
        *text += &format!(
            "  {} {} mm: {} voxels, misfit x, y, z {} {} {} mm{}\n",
            s.recording,
            s.drive_mm,
            s.num_voxels,
            of_component(s.rms_mm[0]),
            of_component(s.rms_mm[1]),
            of_component(s.rms_mm[2]),
            match (s.force_n, s.model_force_n) {
                (Some(f), Some(m)) => format!(", force {} N, model {} N", num(f, 5), num(m, 5)),
                _ => String::new(),
            }
        );
    }
    for note in &result.notes {
        *text += &format!("note: {note}\n");
    }
}
