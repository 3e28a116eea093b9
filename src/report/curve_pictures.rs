//! Pictures of curve fits and of verdicts on load curves.

use super::bars::{BarGroup, GroupedBars};
use super::curves::{CurveSeries, CurvesPlot, Mark};
use crate::homogeneous::{Curve, CurveFit, Deformation, LawComparison, LawEvidence};
use crate::rate::{CurveTrace, LoadCurveVerdict};

/// What a state is drawn at: stretch or amount of shear.
fn abscissa(state: &Deformation) -> f64 {
    match *state {
        Deformation::Uniaxial { stretch } => stretch,
        Deformation::Biaxial { stretches } => stretches[0],
        Deformation::SimpleShear { shear } => shear,
    }
}

/// A stress whose own stretch goes less than this part of the way of the one across is drawn over that one.
const LEAST_WAY: f64 = 0.1;

/// What the states of a curve are drawn at, and what the legend adds to its name.
fn abscissas(curve: &Curve) -> (Vec<f64>, String) {
    let own: Vec<f64> = curve.states.iter().map(abscissa).collect();
    let across = |state: &Deformation| match *state {
        Deformation::Biaxial { stretches } => Some(stretches[1]),
        _ => None,
    };
    let way = |values: &[f64]| {
        let [low, high] = values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(*v), h.max(*v)]);
        high - low
    };
    let across: Vec<f64> = curve.states.iter().filter_map(across).collect();
    match curve.biaxial {
        Some(stress) if way(&own) < LEAST_WAY * way(&across) => (across, format!(" over λ{}", 2 - stress.axis)),
        _ => (own, String::new()),
    }
}

/// Curves with a fit (full line) and other fits (dashed); `is_kept_back` marks curves that were predicted. Each stress
/// of a biaxial test is drawn over its own stretch, that of the second axis with squares; where a width is held, over
/// the stretch across it.
pub fn fit_picture(title: &str, curves: &[(&Curve, bool)], fits: &[&CurveFit]) -> String {
    let of_curve = |(curve, is_kept_back): &(&Curve, bool)| {
        let (drawn_at, over) = abscissas(curve);
        CurveSeries {
            name: format!("{}{over}", curve.name),
            points: drawn_at.iter().zip(&curve.nominal_stress_kpa).map(|(x, p)| [*x, *p]).collect(),
            models: fits.iter().filter_map(|f| f.stress(&curve.states)).collect(),
            is_predicted: *is_kept_back,
            mark: if curve.biaxial.is_some_and(|stress| stress.axis == 1) { Mark::Square } else { Mark::Circle },
        }
    };
    let series = curves.iter().map(of_curve).collect();
    CurvesPlot {
        title: title.into(),
        x_label: "stretch (or amount of shear)".into(),
        y_label: "nominal stress, kPa".into(),
        series,
    }
    .to_svg()
}

/// How much more BIC every law has than the best one.
pub fn law_picture(comparison: &LawComparison) -> String {
    let group = |e: &LawEvidence| {
        let plural = if e.num_parameters == 1 { "" } else { "s" };
        let label = format!("{}: {} parameter{plural}", e.name, e.num_parameters);
        BarGroup { label, values: vec![e.bic_above_best] }
    };
    GroupedBars {
        title: "Laws compared: less is better".into(),
        axis_label: "BIC above the best".into(),
        series: vec!["fitted to all curves".into()],
        groups: comparison.laws.iter().map(group).collect(),
        ..GroupedBars::default()
    }
    .to_svg()
}

fn trace_plot(title: &str, traces: &[CurveTrace], over_time: bool) -> String {
    let series = traces
        .iter()
        .filter(|t| !over_time || !t.time_s.is_empty())
        .map(|t| {
            let x = if over_time { &t.time_s } else { &t.drive };
            CurveSeries {
                name: t.name.clone(),
                points: x.iter().zip(&t.measured_kpa).map(|(x, y)| [*x, *y]).collect(),
                models: vec![t.after_kpa.clone(), t.before_kpa.clone()],
                is_predicted: t.num_fitted == 0,
                mark: Mark::Circle,
            }
        })
        .collect();
    CurvesPlot {
        title: title.into(),
        x_label: if over_time { "time, s".into() } else { "stretch (or amount of shear)".into() },
        y_label: "nominal stress, kPa".into(),
        series,
    }
    .to_svg()
}

/// The pictures of a verdict on load curves, name and SVG: stress over drive and over time (with the causes full, the
/// elastic material dashed, residuals beneath), the evidence of the first stage, and the errors before and after.
pub fn load_curve_pictures(verdict: &LoadCurveVerdict) -> Vec<(String, String)> {
    let first: Vec<BarGroup> = verdict
        .hypotheses
        .iter()
        .filter(|h| h.stage == 1)
        .map(|h| BarGroup { label: h.name.clone(), values: vec![h.delta_bic] })
        .collect();
    let errors: Vec<BarGroup> = verdict
        .fitted
        .iter()
        .map(|m| (m, ""))
        .chain(verdict.kept_back.iter().map(|m| (m, " (predicted)")))
        .map(|(m, suffix)| BarGroup {
            label: format!("{}{suffix}", m.before.name),
            values: vec![100.0 * m.before.relative_rms_error, 100.0 * m.after.relative_rms_error],
        })
        .collect();
    let evidence = GroupedBars {
        title: "Evidence for each hypothesis alone".into(),
        axis_label: "fall of BIC".into(),
        series: vec!["with it".into()],
        groups: first,
        ..GroupedBars::default()
    };
    let errors = GroupedBars {
        title: "Error of each curve".into(),
        axis_label: "rms error, % of the curve's rms".into(),
        series: vec!["elastic".into(), "with the causes".into()],
        groups: errors,
        ..GroupedBars::default()
    };
    let mut all = vec![
        ("load-curves".to_string(), trace_plot("Stress over stretch", &verdict.traces, false)),
        ("load-evidence".to_string(), evidence.to_svg()),
        ("load-errors".to_string(), errors.to_svg()),
    ];
    if verdict.traces.iter().any(|t| !t.time_s.is_empty()) {
        all.insert(1, ("load-history".to_string(), trace_plot("Stress over time", &verdict.traces, true)));
    }
    all
}
