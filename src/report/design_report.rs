//! The page that a person reads after a design search.

use super::{
    BarGroup, CalloutKind, Column, GroupedBars, HistoryPlot, HistoryPoint, LimitBar, LimitsPlot, ParetoPlot,
    ParetoPoint, PointKind, RankedItem, RankingPlot, Report, ReportHeader, Table, design_detection::detection,
    design_verification::verification, significant, symbol_of_parameter,
};
use crate::design::{DesignEntry, DesignResult, block_in_brief, holes_in_brief, plates_in_words};
use crate::specimen::{LimitMargin, Specimen, to_svg_with};

/// Pictures made elsewhere, put in the page where they belong.
#[derive(Clone, Debug, Default)]
pub struct DesignPictures {
    /// (λ, k) histograms, base beside best, with the first material.
    pub histogram: String,
    /// Deformed base and best.
    pub deformed: Vec<(String, String)>,
}

fn show(value: Option<f64>, digits: usize) -> String {
    value.map_or("–".into(), |v| significant(v, digits))
}

/// First of all what to make and how to scan it, how precise that is, what is assumed, and the forces.
fn what_to_do(page: &mut Report, result: &DesignResult) {
    let (advice, recommended) = (&result.recommendation, result.recommended());
    page.section("What to do");
    page.callout(CalloutKind::Finding, "Make this, and scan it like this", &advice.make);
    page.paragraph(&advice.precision);
    page.paragraph(&advice.assumptions);
    let samples = recommended.specimen.samples();
    let tolerances = result.drawing_tolerances();
    let drawings = samples.iter().zip(&tolerances);
    let drawings = drawings.map(|(s, t)| (to_svg_with(s, t), format!("Drawing of \"{}\"; dimensions in mm.", s.name)));
    page.figures(&drawings.collect::<Vec<_>>());
    if !result.tolerances.is_empty() {
        page.paragraph(&advice.dimensions);
        page.table(&tolerance_table(result));
    }
    page.table(&precision_table(result));
    page.table(&force_table(result));
}

/// Promised standard deviations of base and recommended specimen, absolute and relative.
fn precision_table(result: &DesignResult) -> Table {
    let recommended = result.recommended();
    let mut rows = Vec::new();
    for (own, of_base) in recommended.by_material.iter().zip(&result.base.by_material) {
        for p in &own.evaluation.promised_sd {
            let base = of_base.evaluation.promised_sd.iter().find(|b| b.parameter == p.parameter);
            let percent = |sd: Option<f64>| show(sd.map(|sd| 100.0 * sd), 2);
            rows.push(vec![
                own.material.clone(),
                symbol_of_parameter(&p.parameter),
                show(p.value, 2),
                percent(p.relative_sd),
                show(base.and_then(|b| b.value), 2),
                percent(base.and_then(|b| b.relative_sd)),
            ]);
        }
    }
    Table {
        caption: "What one scan promises, all parameters being fitted together: one standard deviation.".into(),
        columns: vec![
            Column::words("Material"),
            Column::words("Parameter"),
            Column::numbers("Recommended", "kPa, 1"),
            Column::numbers("of the value", "%"),
            Column::numbers("Base", "kPa, 1"),
            Column::numbers("of the value", "%"),
        ],
        rows,
        note: "Moduli (μ, κ) in kPa, exponents (α) are pure numbers. κ is hardly seen in such a test.".into(),
        ..Table::default()
    }
}

/// What each dimension of the recommended specimen costs where it is off.
fn tolerance_table(result: &DesignResult) -> Table {
    let percent = |change: Option<f64>| change.map_or("not solved".into(), |c| format!("{:+.2}", 100.0 * c));
    let rows = result.tolerances.iter().map(|t| {
        vec![
            t.name.clone(),
            significant(t.drawn_mm, 3),
            percent(t.relative_change_smaller),
            percent(t.relative_change_larger),
            t.tolerance_mm.map_or("–".into(), |mm| mm.to_string()),
        ]
    });
    let step_mm = result.tolerances.first().map_or(0.0, |t| t.step_mm);
    Table {
        caption: format!("Change of the objective where a dimension is off by {step_mm} mm."),
        columns: vec![
            Column::words("Dimension"),
            Column::numbers("As drawn", "mm"),
            Column::numbers("Smaller", "%"),
            Column::numbers("Larger", "%"),
            Column::numbers("Tolerance", "± mm"),
        ],
        rows: rows.collect(),
        note: "Of the recommended specimen, on the coarse mesh of the search, all else held; mirror images together. On a grid that is \
               centred on the sample it changes in jumps where a row of voxels comes in."
            .into(),
        ..Table::default()
    }
}

/// Forces of base and recommended specimen, each with its material and drive.
fn force_table(result: &DesignResult) -> Table {
    let mut rows = Vec::new();
    for (label, entry) in [("recommended", result.recommended()), ("base", &result.base)] {
        for m in &entry.by_material {
            let of_scan = m.evaluation.steps.iter().map(|s| (s.drive_mm, s.force_n, s.normal_force_n, "scan"));
            let readings = m.evaluation.force_steps.iter();
            let on_the_way = readings.map(|s| (s.drive_mm, s.force_n, None, "force alone"));
            for (drive_mm, force_n, normal_force_n, what) in on_the_way.chain(of_scan) {
                rows.push(vec![
                    label.into(),
                    m.material.clone(),
                    significant(drive_mm, 3),
                    what.into(),
                    significant(force_n, 3),
                    show(normal_force_n, 3),
                ]);
            }
        }
    }
    Table {
        caption: "Forces of all samples together.".into(),
        columns: vec![
            Column::words("Specimen"),
            Column::words("Material"),
            Column::numbers("Drive", "mm"),
            Column::words("What is read"),
            Column::numbers("Force", "N"),
            Column::numbers("Force across the plates", "N"),
        ],
        rows,
        note: "Across the plates of a double-lap test a positive force pulls them together.".into(),
        ..Table::default()
    }
}

/// The report of `result`.
pub fn design_report(result: &DesignResult, pictures: &DesignPictures) -> String {
    let header = ReportHeader {
        subtitle: format!("Recommended: {}", result.recommended().specimen.name),
        program_version: result.version.clone(),
        input_hash: result.input_hash.clone(),
        seed: Some(result.seed),
        facts: vec![
            ("Designs evaluated".into(), result.num_evaluations.to_string()),
            ("Designs that failed".into(), result.failures.len().to_string()),
            ("Designs confirmed".into(), result.ranked.len().to_string()),
        ],
    };
    let mut page = Report::new(result.name.clone(), header);
    what_to_do(&mut page, result);
    page.section("What was found");
    page.list(&result.findings);
    if !pictures.deformed.is_empty() {
        page.subsection("Under load");
        page.figures(&pictures.deformed);
    }
    page.section("Best against base");
    page.table(&gains_table(&result.best));
    page.figures(&gain_bars(result));
    detection(&mut page, result);
    if !pictures.histogram.is_empty() {
        page.figure(
            &pictures.histogram,
            "Where the voxels lie: stretch amplitude λ against deformation mode k (0 equibiaxial, ½ pure shear, 1 uniaxial), \
             logarithmic density, first material.",
        );
    }
    if !result.verification_by_material.is_empty() {
        verification(&mut page, result);
    }
    page.section("Designs compared");
    page.table(&ranked_table(result));
    page.figures(&[(pareto_plot(result).to_svg(), "Information against force; the front is marked.")]);
    for (index, d) in result.disagreement.iter().enumerate() {
        let items = result.ranked.iter().enumerate().map(|(i, entry)| RankedItem {
            label: format!("{}. {}", i + 1, count_of_holes(entry)),
            left: least_sensitivity_gain(entry, &d.material),
            right: information_gain(entry, &result.base, index),
            is_base: false,
            is_best: i == 0,
        });
        let plot = RankingPlot {
            title: format!("Rankings, material \"{}\"", d.material),
            left_label: "integrated sensitivity".into(),
            right_label: "Fisher information (D)".into(),
            larger_left_is_better: true,
            larger_right_is_better: true,
            items: items.collect(),
        };
        let caption = format!(
            "The confirmed designs ranked by the least gain in 𝒮 and by the gain in the generalised standard deviation, both over \
             the base; Kendall's τ = {}.",
            show(d.kendall_tau, 2)
        );
        page.figure(&plot.to_svg(), &caption);
    }
    page.section("Limits of the best specimen");
    let limits = LimitsPlot {
        title: String::new(),
        limits: result
            .best
            .limits
            .iter()
            .map(|m| LimitBar {
                name: m.plain_name().into(),
                unit: m.unit().into(),
                value: m.value,
                limit: m.limit,
                margin_relative: m.margin_relative,
                is_satisfied: m.is_satisfied,
            })
            .collect(),
    };
    page.figure(&limits.to_svg(), "Relative margin to every limit, closest first.");
    page.section("The search");
    let history = HistoryPlot {
        title: String::new(),
        y_label: "gain over the base".into(),
        larger_is_better: true,
        is_log: false,
        base: Some(1.0),
        points: result
            .history
            .iter()
            .map(|v| HistoryPoint {
                value: if *v > 0.0 { *v } else { f64::NAN },
                is_feasible: true,
                phase: String::new(),
            })
            .collect(),
    };
    page.figure(&history.to_svg(), "Best gain within all limits after each evaluation, at search fidelity.");
    page.paragraph(&format!(
        "{} Gains are relative to the base specimen at its drive; confirmed values are means over three meshes, with the scan's \
         own voxels. Seed {}.",
        result.objective.words(),
        result.seed
    ));
    page.to_html()
}

fn count_of_holes(entry: &DesignEntry) -> String {
    match entry.specimen.holes.len() {
        0 => "solid".into(),
        1 => "1 hole".into(),
        n => format!("{n} holes"),
    }
}

/// The least gain in 𝒮 over a material's parameters; NaN without any.
fn least_sensitivity_gain(entry: &DesignEntry, material: &str) -> f64 {
    let of_material = entry.gains.iter().filter(|g| g.material == material);
    of_material.filter_map(|g| g.integrated_sensitivity).reduce(f64::min).unwrap_or(f64::NAN)
}

/// Gain in a material's generalised standard deviation; NaN where it is not determined.
fn information_gain(entry: &DesignEntry, base: &DesignEntry, material: usize) -> f64 {
    let of = |e: &DesignEntry| e.by_material.get(material)?.relative_sd_by_criterion.d_optimal;
    of(base).zip(of(entry)).map_or(f64::NAN, |(base, own)| base / own)
}

/// Something of every sample, in their order.
fn of_samples(entry: &DesignEntry, of: fn(&Specimen) -> String) -> String {
    entry.specimen.samples().iter().map(of).collect::<Vec<_>>().join("; ")
}

fn gains_table(best: &DesignEntry) -> Table {
    Table {
        caption: "Gains of the best specimen over the base; above 1 is better.".into(),
        columns: vec![
            Column::words("Material"),
            Column::words("Parameter"),
            Column::numbers("Integrated sensitivity", "×"),
            Column::numbers("Promised sd, base / best", "×"),
            Column::numbers("the least over the variants", "×"),
        ],
        rows: best
            .gains
            .iter()
            .map(|g| {
                vec![
                    g.material.clone(),
                    symbol_of_parameter(&g.parameter),
                    show(g.integrated_sensitivity, 3),
                    show(g.promised_sd, 3),
                    show(g.worst_promised_sd, 3),
                ]
            })
            .collect(),
        note: "Variants: the material's stiffer and softer values that the study names as uncertain.".into(),
        ..Table::default()
    }
}

fn gain_bars(result: &DesignResult) -> Vec<(String, String)> {
    result
        .base
        .by_material
        .iter()
        .zip(&result.best.by_material)
        .map(|(base, best)| {
            let groups = base
                .evaluation
                .promised_sd
                .iter()
                .zip(&best.evaluation.promised_sd)
                .map(|(a, b)| BarGroup {
                    label: symbol_of_parameter(&a.parameter),
                    values: [a, b].map(|p| p.relative_sd.map_or(f64::NAN, |r| 100.0 * r)).to_vec(),
                })
                .collect();
            let bars = GroupedBars {
                title: format!("Promised standard deviation, material \"{}\"", base.material),
                axis_label: "% of the parameter".into(),
                series: vec!["base".into(), "best".into()],
                groups,
                is_log: true,
                missing_label: "not determined".into(),
                ..GroupedBars::default()
            };
            (bars.to_svg(), "What one scan promises, all parameters being fitted together.".to_string())
        })
        .collect()
}

fn drives_and_plates(specimen: &Specimen) -> String {
    let drives = specimen.drive_mm.iter().map(|d| significant(*d, 3));
    drives.chain(plates_in_words(specimen)).collect::<Vec<_>>().join(", ")
}

fn ranked_table(result: &DesignResult) -> Table {
    let of_material = |found: Option<(&str, f64)>| {
        found.map_or("–".into(), |(material, n)| format!("{} ({material})", significant(n, 3)))
    };
    let row = |label: String, entry: &DesignEntry| {
        vec![
            label,
            of_samples(entry, holes_in_brief),
            of_samples(entry, block_in_brief),
            drives_and_plates(&entry.specimen),
            of_material(entry.largest_force()),
            of_material(entry.largest_normal_force()),
            format!(
                "{} ± {}",
                significant(entry.objective, 4),
                significant(entry.objective * entry.mesh_relative_sd, 1)
            ),
            show(entry.information().map(|i| 100.0 * i), 3),
            if entry.is_within_limits {
                entry.limits.first().map_or("none".into(), LimitMargin::in_words)
            } else {
                format!("not kept: {}", entry.not_kept())
            },
        ]
    };
    let remarks: Vec<String> = result
        .ranked
        .iter()
        .enumerate()
        .filter_map(|(i, e)| Some(format!("{}: {}", i + 1, e.remark.as_ref()?)))
        .collect();
    let mut rows = vec![row("base".into(), &result.base)];
    let rank = |place: usize| {
        let equal = if place > 0 && result.equal_to_best.contains(&place) { " (as good as 1)" } else { "" };
        let chosen = if place == result.simplest { ", recommended" } else { "" };
        format!("{}{equal}{chosen}", place + 1)
    };
    rows.extend(result.ranked.iter().enumerate().map(|(i, e)| row(rank(i), e)));
    Table {
        caption: "Confirmed designs, best first.".into(),
        columns: vec![
            Column::words("Rank"),
            Column::words("Holes"),
            Column::words("Block, mm"),
            Column::numbers("Drive", "mm"),
            Column::numbers("Largest force", "N"),
            Column::numbers("Force across the plates", "N"),
            Column::numbers("Gain", "×"),
            Column::numbers("Generalised sd", "%"),
            Column::words("Closest limit"),
        ],
        rows,
        emphasised_rows: vec![1 + result.simplest],
        note: format!("Generalised sd: (det C)^(1/2n) of all μ and α of the first material. {}", remarks.join(" ")),
    }
}

fn pareto_plot(result: &DesignResult) -> ParetoPlot {
    let point = |label: String, entry: &DesignEntry, kind: PointKind| ParetoPoint {
        x: entry.force_n(),
        y: entry.information().map_or(f64::NAN, |i| 100.0 * i),
        label,
        kind,
    };
    let mut points = vec![point("base".into(), &result.base, PointKind::Base)];
    for (index, entry) in result.ranked.iter().enumerate() {
        let kind = if index == 0 {
            PointKind::Best
        } else if !entry.is_within_limits {
            PointKind::Infeasible
        } else if result.pareto.contains(&index) {
            PointKind::Front
        } else {
            PointKind::Dominated
        };
        points.push(point((index + 1).to_string(), entry, kind));
    }
    ParetoPlot {
        title: String::new(),
        x_label: "largest force over the materials at the drive of the scan, N".into(),
        y_label: "generalised sd, %".into(),
        is_log_x: false,
        is_log_y: false,
        larger_x_is_better: false,
        larger_y_is_better: false,
        points,
    }
}
