//! Fits of curves as text.

use crate::homogeneous::{CurveFit, CurveFitSequence, CurveMatch, DumbbellFit};

pub(in crate::job) fn uniaxial(name: &str, families: &[CurveFitSequence], conversion: Option<&DumbbellFit>) -> String {
    let mut text = format!("{name}\n");
    if let Some(c) = conversion {
        text += &format!(
            "\ngrip to gauge by finite elements: {} rounds, last change {:.1e} of the largest strain, finite element force \
             within {:.2} % of the data\n  displacement mm   gauge stretch     force N\n",
            c.num_rounds,
            c.last_change,
            100.0 * c.force_mismatch
        );
        for p in &c.conversion {
            text += &format!("  {:>15.3} {:>15.4} {:>11.4}\n", p.displacement_mm, p.gauge_stretch, p.force_n);
        }
    }
    for family in families {
        text += if family.neo_hookean { "\nwith a neo-Hookean term (alpha = 2 held)\n" } else { "\nfree terms\n" };
        text += &sequence_table(family);
        text += &fit_table(family.chosen());
    }
    text
}

/// The fits of one family and the rules' choices.
fn sequence_table(sequence: &CurveFitSequence) -> String {
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
fn fit_table(fit: &CurveFit) -> String {
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

/// Joint fits, the one that is used, and what it predicts of curves kept back.
pub(in crate::job) fn curves(sequence: &CurveFitSequence, used: &CurveFit, kept_back: &[CurveMatch]) -> String {
    let mut text = sequence_table(sequence);
    text += &format!("\n{} terms\n", used.num_terms);
    text += &fit_table(used);
    for m in kept_back {
        text += &format!(
            "  predicted, kept back: {}: R² {:.5}, rms error {:.3} kPa ({:.2} %), largest {:.3} kPa\n",
            m.name,
            m.r_squared,
            m.rms_error_kpa,
            100.0 * m.relative_rms_error,
            m.largest_error_kpa
        );
    }
    text
}
