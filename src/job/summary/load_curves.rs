//! A diagnosis of load curves as text.

use crate::rate::LoadCurveVerdict;

pub(in crate::job) fn load_curves(v: &LoadCurveVerdict) -> String {
    let mut text = format!("{}\n", v.summary);
    for c in &v.causes {
        text += &format!("\n{} ({}): {}\n", c.name, c.category, c.model);
        for p in &c.parameters {
            let interval = p.interval_95.map_or("not bounded by the data".into(), |[a, b]| format!("{a:.4} to {b:.4}"));
            text += &format!("  {:<24} {:>10.4}   {interval}\n", p.name, p.value);
        }
        text += &format!("  BIC rises by {:.0} without it\n", c.delta_bic);
        if !c.ambiguous_with.is_empty() {
            text += &format!("  not told apart from: {}\n", c.ambiguous_with.join(", "));
        }
    }
    text += "\nerror, % of the curve's rms    elastic -> with the causes\n";
    for (list, note) in [(&v.fitted, ""), (&v.kept_back, " (predicted)")] {
        for m in list {
            let percent = |x: f64| 100.0 * x;
            text += &format!(
                "  {:<36} {:>7.2} -> {:.2}\n",
                format!("{}{note}", m.before.name),
                percent(m.before.relative_rms_error),
                percent(m.after.relative_rms_error)
            );
        }
    }
    let [before, after] = [&v.naive_material, &v.material].map(|m| m.initial_shear_modulus_kpa);
    text += &format!("\ninitial shear modulus {:.3} -> {:.3} kPa\n", before.value, after.value);
    text
}
