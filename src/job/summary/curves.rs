//! Fits of curves as text.

use super::num;
use crate::homogeneous::{
    CurveFit, CurveFitSequence, CurveMatch, DumbbellFit, LawComparison, LawEvidence, MIN_BIC_DIFFERENCE,
};

pub(in crate::job) fn uniaxial(
    name: &str,
    families: &[CurveFitSequence],
    laws: &LawComparison,
    conversion: Option<&DumbbellFit>,
) -> String {
    let mut text = format!("{name}\n");
    if let Some(c) = conversion {
        text += &format!(
            "\ngrip to gauge by finite elements: {} rounds, last change {} of the largest strain, finite element force \
             within {} % of the data\n  displacement mm   gauge stretch     force N\n",
            c.num_rounds,
            num(c.last_change, 2),
            num(100.0 * c.force_mismatch, 4)
        );
        for p in &c.conversion {
            text += &format!(
                "  {:>15} {:>15} {:>11}\n",
                num(p.displacement_mm, 4),
                num(p.gauge_stretch, 5),
                num(p.force_n, 5)
            );
        }
    }
    for family in families {
        text += &match (family.law, family.neo_hookean) {
            (Some(kind), _) => format!("\nlaw of {}\n", kind.name()),
            (None, true) => "\nwith a neo-Hookean term (alpha = 2 held)\n".into(),
            (None, false) => "\nfree terms\n".into(),
        };
        // Of a law there is one fit, whose evidence stands beside that of the others.
        if family.law.is_none() {
            text += &sequence_table(family);
        }
        text += &fit_table(family.chosen());
    }
    if let [free, held] = families {
        let (free, held) = (free.chosen(), held.chosen());
        text += &format!(
            "\nuse the fit of free terms ({}), which material.json holds; the one with a neo-Hookean term is for models that \
             must have it: its misfit is {} times as large\n",
            free.name(),
            num(held.sum_of_squares / free.sum_of_squares, 3)
        );
    }
    if let Some(family) = families.first() {
        text += &law_table(laws, family.chosen());
    }
    text
}

/// The fits of one family and the rules' choices.
fn sequence_table(sequence: &CurveFitSequence) -> String {
    let s = &sequence.selection;
    let mut text = String::from(
        "  model               parameters  misfit        decrement        F      p(F)       BIC   shear modulus kPa (95 %)\n",
    );
    for (model, fit) in s.models.iter().zip(&sequence.fits) {
        let g = fit.initial_shear_modulus_kpa;
        let optional = |v: Option<f64>, width: usize, digits: usize| {
            v.map_or_else(|| format!("{:>width$}", "-"), |v| format!("{:>width$}", num(v, digits + 2)))
        };
        let probability = model.f_probability.map_or_else(|| format!("{:>9}", "-"), |p| format!("{:>9}", num(p, 2)));
        text += &format!(
            "  {:<20}{:>9}  {:<11}{} {} {} {:>9}   {} ({} to {})\n",
            model.name,
            model.num_parameters,
            num(model.sum_of_squares, 5),
            optional(model.decrement, 11, 3),
            optional(model.f_value, 8, 1),
            probability,
            num(model.bic, 7),
            num(g.value, 4),
            num(g.interval_95[0], 4),
            num(g.interval_95[1], 4)
        );
    }
    let name = |i: usize| s.models.get(i).map_or("-", |m| m.name.as_str());
    text += &format!(
        "  chosen: {} (by BIC, which decides; decrement {}, F-test {}); {} data worth {} independent ones\n",
        name(s.by_bic),
        name(s.by_decrement),
        name(s.by_f_test),
        s.num_data,
        num(s.num_independent, 3)
    );
    text
}

/// All laws side by side, and whether another one than `used` describes the curves better.
fn law_table(laws: &LawComparison, used: &CurveFit) -> String {
    let mut text = String::from(
        "\nlaws compared\n  law                 parameters  misfit            BIC  above the best   shear modulus kPa (95 %)\n",
    );
    for e in &laws.laws {
        let g = e.initial_shear_modulus_kpa;
        text += &format!(
            "  {:<20}{:>9}  {:<10}{:>11} {:>15}   {} ({} to {})\n",
            e.name,
            e.num_parameters,
            num(e.sum_of_squares, 5),
            num(e.bic, 7),
            num(e.bic_above_best, 4),
            num(g.value, 4),
            num(g.interval_95[0], 4),
            num(g.interval_95[1], 4)
        );
    }
    for left_out in &laws.left_out {
        text += &format!("  {}: {}\n", left_out.name, left_out.reason);
    }
    let with = |e: &LawEvidence| {
        let plural = if e.num_parameters == 1 { "" } else { "s" };
        format!("{} ({} parameter{plural})", e.name, e.num_parameters)
    };
    if let Some(used) = laws.of(used) {
        text += &match laws.better_than(used) {
            Some(better) => format!("  {} describes the curves better than {}\n", with(better), with(used)),
            None => format!("  no law describes the curves better than {}\n", with(used)),
        };
    }
    text + &format!(
        "  {} data worth {} independent ones; a BIC of {MIN_BIC_DIFFERENCE} less is the least that counts\n",
        laws.num_data,
        num(laws.num_independent, 3)
    )
}

/// One fit's parameters and matches.
fn fit_table(fit: &CurveFit) -> String {
    let mut text = String::from("  parameter        value         sd   95 % interval\n");
    for (index, p) in fit.parameters.iter().enumerate() {
        // What keeps its sign is as good as unknown where it scatters by more than itself; an exponent or a coefficient
        // near zero may be well known all the same.
        let keeps_sign = match fit.law {
            None => index % 2 == 0,
            Some(kind) => kind.parameters().get(index).is_some_and(|p| !p.has_any_sign()),
        };
        let is_unknown = |sd: f64| keeps_sign && sd > p.value.abs();
        let rest = match (p.held, p.sd, p.interval_95) {
            (true, _, _) => "      held".to_string(),
            (_, Some(sd), _) if is_unknown(sd) => format!("{:>10}   not identifiable", num(sd, 5)),
            (_, Some(sd), Some([low, high])) => format!("{:>10}   {} to {}", num(sd, 5), num(low, 5), num(high, 5)),
            _ => "   not identifiable".into(),
        };
        text += &format!("  {:<9} {:>12} {rest}\n", p.name, num(p.value, 5));
    }
    text += match fit.bulk_kpa {
        Some(_) => "  kappa is held\n",
        None => "  kappa     not identifiable (the incompressible limit is fitted)\n",
    };
    let width = fit.curves.iter().map(|m| m.name.chars().count()).fold(20, usize::max);
    text += &format!("  {:<width$} points        R²    rms error kPa   relative\n", "curve");
    for m in &fit.curves {
        text += &format!(
            "  {:<width$} {:>6} {:>9} {:>16} {:>9} %\n",
            m.name,
            m.num_points,
            num(m.r_squared, 6),
            num(m.rms_error_kpa, 4),
            num(100.0 * m.relative_rms_error, 4)
        );
    }
    for note in &fit.notes {
        text += &format!("  note: {note}\n");
    }
    text
}

/// Joint fits, the one that is used, and what it predicts of curves kept back.
pub(in crate::job) fn curves(
    sequence: &CurveFitSequence,
    used: &CurveFit,
    laws: &LawComparison,
    kept_back: &[CurveMatch],
) -> String {
    let mut text = match used.law {
        // Of a law there is one fit, whose evidence stands beside that of the others.
        Some(kind) => format!("law of {}\n", kind.name()),
        None => {
            let plural = if used.num_terms == 1 { "" } else { "s" };
            sequence_table(sequence) + &format!("\n{} term{plural}\n", used.num_terms)
        }
    };
    text += &fit_table(used);
    for m in kept_back {
        text += &format!(
            "  predicted, kept back: {}: R² {}, rms error {} kPa ({} %), largest {} kPa\n",
            m.name,
            num(m.r_squared, 6),
            num(m.rms_error_kpa, 4),
            num(100.0 * m.relative_rms_error, 4),
            num(m.largest_error_kpa, 4)
        );
    }
    text + &law_table(laws, used)
}
