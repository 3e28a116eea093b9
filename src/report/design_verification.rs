//! The report's section on the verification: what calibration on synthetic noisy scans found beside what was promised.

use super::html::Report;
use super::{CalloutKind, Column, SpreadPlot, SpreadRow, Table, significant, symbol_of_parameter};
use crate::calibration::{ParameterSpread, TWO_SIDED_95};
use crate::design::DesignResult;
use crate::material::Parameter;

/// Share of the draws whose interval, estimate ± 1.96 promised standard deviations, holds the truth once the mesh's
/// shift is taken out; `None` where nothing is promised or found.
fn coverage(p: &ParameterSpread) -> Option<f64> {
    let sd = p.promised_sd?;
    let shift = p.discretisation_bias.unwrap_or(0.0);
    let is_held = |estimate: &&f64| (**estimate - shift - p.truth).abs() <= TWO_SIDED_95 * sd;
    let count = p.estimates.iter().filter(is_held).count();
    (!p.estimates.is_empty()).then(|| count as f64 / p.estimates.len() as f64)
}

fn show(value: Option<f64>, digits: usize) -> String {
    value.filter(|v| v.is_finite()).map_or("–".into(), |v| significant(v, digits))
}

fn row(specimen: &str, p: &ParameterSpread) -> Vec<String> {
    let failed = if p.failed_draws > 0 { format!(" (+{} failed)", p.failed_draws) } else { String::new() };
    let limited = if p.limited_draws > 0 { format!(" ({} at a limit)", p.limited_draws) } else { String::new() };
    vec![
        specimen.to_string(),
        symbol_of_parameter(&p.parameter),
        significant(p.truth, 4),
        show(p.promised_sd, 3),
        show(Some(p.found_sd), 3),
        show(p.found_over_promised(), 3),
        coverage(p).map_or("–".into(), |c| format!("{:.0}", 100.0 * c)),
        show(Some(p.mean - p.truth), 2),
        show(p.discretisation_bias, 2),
        format!("{}{failed}{limited}", p.draws),
        if p.doubts.is_empty() { "yes".into() } else { "no (see above)".into() },
    ]
}

/// Adds the section.
pub(super) fn verification(page: &mut Report, result: &DesignResult) {
    page.section("Verification");
    page.paragraph(
        "Both specimens were calibrated on synthetic scans of a known material, with fresh noise in every draw. One more such scan was \
         fitted from 30 % off the truth; the fits to the draws begin at its estimate. The spread of the estimates is set beside the spread promised: a ratio near 1 means that the promise \
         can be trusted.",
    );
    let (failures, doubts) = (result.verification_failures(), result.verification_doubts());
    page.list(&failures);
    let is_whole = result.verification_by_material.iter().all(|v| !v.best.is_empty() && !v.base.is_empty());
    if doubts.is_empty() && failures.is_empty() && is_whole {
        page.paragraph("No row of these tables gives a reason to doubt what is promised.");
    } else if !doubts.is_empty() {
        page.callout(CalloutKind::Caution, "Not to be trusted", &doubts.join("\n\n"));
    }
    for v in &result.verification_by_material {
        let (mut table_rows, mut rows) = (Vec::new(), Vec::new());
        for (label, list) in [("best", &v.best), ("base", &v.base)] {
            for p in list {
                table_rows.push(row(label, p));
                rows.push(SpreadRow {
                    specimen: label.into(),
                    parameter: symbol_of_parameter(&p.parameter),
                    unit: if Parameter::named(&p.parameter).is_some_and(Parameter::is_modulus) {
                        "kPa".into()
                    } else {
                        String::new()
                    },
                    truth: p.truth,
                    found: p.estimates.clone(),
                    promised_sd: p.promised_sd.unwrap_or(f64::NAN),
                });
            }
        }
        let all = v.best.iter().chain(&v.base);
        let doubtful = all.enumerate().filter(|(_, p)| !p.doubts.is_empty()).map(|(n, _)| n).collect();
        let is_corrected = v.best.iter().chain(&v.base).any(|p| p.is_mesh_corrected);
        let draws = v.best.first().map_or(0, |p| p.draws + p.failed_draws);
        page.table(&Table {
            caption: format!("Material \"{}\".", v.material),
            columns: vec![
                Column::words("Specimen"),
                Column::words("Parameter"),
                Column::numbers("Truth", ""),
                Column::numbers("Promised sd", ""),
                Column::numbers("Found sd", ""),
                Column::numbers("Found / promised", ""),
                Column::numbers("Coverage", "%"),
                Column::numbers("Bias", ""),
                Column::numbers("of it mesh", ""),
                Column::numbers("Draws", ""),
                Column::words("To be trusted"),
            ],
            emphasised_rows: doubtful,
            rows: table_rows,
            note: format!(
                "Moduli in kPa. Bias: mean of the estimates less the truth. Of it mesh: what a fit to the scan without noise misses the \
                 truth by; the scan is made on a finer mesh than the fit uses, so this part comes from the fit's mesh and not from the \
                 specimen or the noise{}. Coverage: draws whose estimate ± 1.96 promised sd holds the \
                 truth, the mesh's part taken out; 95 is right. With {draws} draws a found sd is itself uncertain by about {:.0} %.",
                if is_corrected { " (the fits are corrected by a mesh between the two)" } else { "" },
                100.0 * ParameterSpread::spread_error(draws)
            ),
        });
        let plot = SpreadPlot { title: format!("Material \"{}\"", v.material), rows };
        page.figure(&plot.to_svg(), "Each draw's estimate, the truth, and ± the promised standard deviation.");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Estimates 1, 2, 3 around a truth of 2 with a promise of 0.4: only the middle one is within 1.96 × 0.4; a mesh
    /// shift of 1 makes it the last one.
    #[test]
    fn coverage_takes_the_mesh_out() {
        let mut p = ParameterSpread {
            parameter: "mu_1".into(),
            truth: 2.0,
            mean: 2.0,
            found_sd: 1.0,
            promised_sd: Some(0.4),
            identifiable: true,
            draws: 3,
            failed_draws: 0,
            estimates: vec![1.0, 2.0, 3.0],
            discretisation_bias: None,
            is_mesh_corrected: false,
            limited_draws: 0,
            doubts: Vec::new(),
        };
        let third = 1.0 / 3.0;
        assert!((coverage(&p).expect("promised") - third).abs() < 1e-12);
        p.discretisation_bias = Some(1.0);
        assert!((coverage(&p).expect("promised") - third).abs() < 1e-12);
        p.estimates = vec![2.9, 3.1, 2.0, 4.0];
        assert!((coverage(&p).expect("promised") - 0.5).abs() < 1e-12);
        p.promised_sd = None;
        assert_eq!(coverage(&p), None);
    }
}
