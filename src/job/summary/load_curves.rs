//! A diagnosis of load curves as text.

use super::num;
use crate::rate::LoadCurveVerdict;

pub(in crate::job) fn load_curves(v: &LoadCurveVerdict) -> String {
    let mut text = format!("{}\n", v.summary);
    for c in &v.causes {
        text += &format!("\n{} ({}): {}\n", c.name, c.category, c.model);
        for p in &c.parameters {
            let interval = p
                .interval_95
                .map_or("not bounded by the data".into(), |[a, b]| format!("{} to {}", num(a, 5), num(b, 5)));
            text += &format!("  {:<24} {:>10}   {interval}\n", p.name, num(p.value, 5));
        }
        text += &format!("  BIC rises by {} without it\n", num(c.delta_bic, 4));
        if !c.ambiguous_with.is_empty() {
            text += &format!("  not told apart from: {}\n", c.ambiguous_with.join(", "));
        }
    }
    text += "\nerror, % of the curve's rms    elastic -> with the causes\n";
    for (list, note) in [(&v.fitted, ""), (&v.kept_back, " (predicted)")] {
        for m in list {
            let percent = |x: f64| 100.0 * x;
            text += &format!(
                "  {:<36} {:>7} -> {}\n",
                format!("{}{note}", m.before.name),
                num(percent(m.before.relative_rms_error), 4),
                num(percent(m.after.relative_rms_error), 4)
            );
        }
    }
    let [before, after] = [&v.naive_material, &v.material].map(|m| m.initial_shear_modulus_kpa);
    text += &format!("\ninitial shear modulus {} -> {} kPa\n", num(before.value, 4), num(after.value, 4));
    text
}
