//! Fits of curves as text.

use crate::homogeneous::{CurveFit, CurveFitSequence};

/// The fits of one family and the rules' choices.
pub(super) fn sequence_table(sequence: &CurveFitSequence) -> String {
    let s = &sequence.selection;
    let mut text = String::from(
        "  model               parameters  misfit      decrement        F      p(F)       BIC   shear modulus kPa (95 %)\n",
    );
    for (model, fit) in s.models.iter().zip(&sequence.fits) {
        let g = fit.initial_shear_modulus_kpa;
        let optional = |v: Option<f64>, width: usize, digits: usize| {
            v.map_or_else(|| format!("{:>width$}", "-"), |v| format!("{v:>width$.digits$}"))
        };
        let probability = model.f_probability.map_or_else(|| format!("{:>9}", "-"), |p| format!("{p:>9.1e}"));
        text += &format!(
            "  {:<20}{:>9}  {:<10.4e}{} {} {} {:>9.1}   {:.2} ({:.2} to {:.2})\n",
            model.name,
            model.num_parameters,
            model.sum_of_squares,
            optional(model.decrement, 10, 3),
            optional(model.f_value, 8, 1),
            probability,
            model.bic,
            g.value,
            g.interval_95[0],
            g.interval_95[1]
        );
    }
    let name = |i: usize| s.models.get(i).map_or("-", |m| m.name.as_str());
    text += &format!(
        "  chosen: {} (by BIC, which decides; decrement {}, F-test {}); {} data worth {:.0} independent ones\n",
        name(s.by_bic),
        name(s.by_decrement),
        name(s.by_f_test),
        s.num_data,
        s.num_independent
    );
    text
}

/// One fit's parameters and matches.
pub(super) fn fit_table(fit: &CurveFit) -> String {
    let mut text = String::from("  parameter        value         sd   95 % interval\n");
    for p in &fit.parameters {
        let rest = match (p.held, p.sd, p.interval_95) {
            (true, _, _) => "      held".to_string(),
            (_, Some(sd), Some([low, high])) => format!("{sd:>10.4}   {low:.4} to {high:.4}"),
            _ => "   not identifiable".into(),
        };
        text += &format!("  {:<9} {:>12.4} {rest}\n", p.name, p.value);
    }
    text += match fit.bulk_kpa {
        Some(_) => "  kappa is held\n",
        None => "  kappa     not identifiable (the incompressible limit is fitted)\n",
    };
    text += "  curve                points        R²    rms error kPa   relative\n";
    for m in &fit.curves {
        text += &format!(
            "  {:<20} {:>6} {:>9.5} {:>16.3} {:>9.2} %\n",
            m.name,
            m.num_points,
            m.r_squared,
            m.rms_error_kpa,
            100.0 * m.relative_rms_error
        );
    }
    for note in &fit.notes {
        text += &format!("  note: {note}\n");
    }
    text
}
