//! A design search as text.

use super::num;
use crate::design::{DesignEntry, DesignResult, plates_in_words};
use crate::report::{ComparedSize, compared_sizes};
use crate::specimen::LimitMargin;

/// The result as text.
pub(in crate::job) fn design(result: &DesignResult) -> String {
    let mut text = format!("{}\n\n", result.name);
    let advice = &result.recommendation;
    let all = [&advice.make, &advice.precision, &advice.assumptions, &advice.dimensions];
    for said in all.into_iter().filter(|said| !said.is_empty()) {
        text += &format!("{said}\n\n");
    }
    for sentence in &result.findings {
        text += &format!("* {sentence}\n");
    }
    // Bars have no plates, and a table of bars alone no force across them.
    let has_plates = result.ranked.iter().chain([&result.base]).any(|e| e.specimen.has_plates());
    let across = |shown: String| if has_plates { format!(" {shown:>16}") } else { String::new() };
    let name = across("across plates N".into());
    text += &format!(
        "\n  design                                     drive mm   largest force N{name}   gain   closest limit\n"
    );
    let line = |label: &str, e: &DesignEntry| {
        let normal = e.largest_normal_force().map_or("-".into(), |(_, force_n)| num(force_n, 4));
        let plates = plates_in_words(&e.specimen).map_or(String::new(), |plates| format!("; {plates}"));
        format!(
            "  {:<42} {:>8} {:>17}{} {:>6}   {}{plates}\n",
            label,
            num(e.specimen.drive_mm.last().copied().unwrap_or(0.0), 5),
            num(e.force_n(), 4),
            across(normal),
            num(e.objective, 4),
            if e.is_within_limits {
                e.limits.first().map_or("none".into(), LimitMargin::in_words)
            } else {
                format!("not kept: {}", e.not_kept())
            }
        )
    };
    text += &line("base", &result.base);
    for (index, entry) in result.ranked.iter().take(8).enumerate() {
        text += &line(&format!("{}. {}", index + 1, entry.specimen.name), entry);
    }
    text += "\n  gains of the best over the base (above 1: better)\n";
    text += "  material     parameter   integrated sensitivity   promised standard deviation\n";
    for g in &result.best.gains {
        let show = |v: Option<f64>| v.map_or("-".into(), |v| num(v, 4));
        text += &format!(
            "  {:<12} {:<11} {:>22} {:>29}\n",
            g.material,
            g.parameter,
            show(g.integrated_sensitivity),
            show(g.promised_sd)
        );
    }
    let sizes = compared_sizes(result);
    if !sizes.is_empty() {
        text += "\n  errors that a diagnosis would name with 90 % probability, from these sizes on\n";
        text += "  material     cause          parameter                                   base   recommended\n";
    }
    for s in &sizes {
        let [base, own] = [s.base, s.recommended].map(ComparedSize::shown);
        text += &format!("  {:<12} {:<14} {:<36} {base:>11} {own:>13}\n", s.material, s.cause, s.parameter);
    }
    for v in &result.verification_by_material {
        text += &format!("\n  verification on synthetic noisy scans, material \"{}\"\n", v.material);
        text += "  specimen   parameter        truth         mean     found sd   promised sd   ratio   draws\n";
        for (label, list) in [("best", &v.best), ("base", &v.base)] {
            for p in list {
                let show = |v: Option<f64>, digits: usize| {
                    v.filter(|v| v.is_finite()).map_or("-".into(), |v| num(v, digits + 1))
                };
                text += &format!(
                    "  {:<10} {:<10} {:>11} {:>12} {:>12} {:>13} {:>7} {:>7}\n",
                    label,
                    p.parameter,
                    num(p.truth, 5),
                    show(Some(p.mean), 4),
                    show(Some(p.found_sd), 4),
                    show(p.promised_sd, 4),
                    show(p.found_over_promised(), 2),
                    p.draws
                );
            }
        }
    }
    for doubt in result.verification_doubts() {
        text += &format!("\n* Caution. {doubt}\n");
    }
    for sentence in result.verification_failures() {
        text += &format!("\n* {sentence}\n");
    }
    text
}
