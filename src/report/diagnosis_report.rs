//! The report of a diagnosis: verdict, causes, what was left before and after, what was tested, the load curve, where a
//! misfit may come from.

use super::diagnosis_pictures::DiagnosisPictures;
use super::html::{Report, ReportHeader};
use super::html_parts::{CalloutKind, Column, Table};
use super::number::significant;
use super::plain_words::in_plain_words;
use crate::diagnosis::{CauseResult, Diagnosis, DiagnosisResult, Verdict};

/// The page.
pub fn diagnosis_report(d: &Diagnosis, r: &DiagnosisResult) -> Report {
    let mut page = Report::new(verdict_words(r.verdict), header(d, r));
    page.section("In plain words");
    in_plain_words(&mut page, d, r);
    page.section("What was found");
    verdict(&mut page, r);
    interior(&mut page, r);
    for cause in &r.causes {
        describe(&mut page, cause);
    }
    page.section("Before and after");
    before_and_after(&mut page, r);
    materials(&mut page, d, r);
    let pictures = DiagnosisPictures::new(d);
    let [before, after] = &pictures.residuals;
    page.figure(before, "Measured minus nominal model at the largest drive. Each map has a scale of its own (see its bar): 19 of 20 voxels are within it, and it is no less than three standard deviations of the noise.");
    page.figure(after, "The same with the causes modelled, on scales of their own.");
    if let Some(svg) = &pictures.law {
        page.figure(svg, "Nominal stress of the incompressible material in homogeneous tests, up to the states that the largest drive brings about: the Ogden terms alone, and with the correction of the law.");
    }
    if let Some(svg) = &pictures.load_curve {
        page.section("Load curve");
        page.figure(svg, "Force over time; measured minus modelled below.");
    }
    page.section("What was tested");
    page.figure(
        &pictures.evidence,
        "Fall of the deviance to first order (score test) and in a full nonlinear fit, of the first round.",
    );
    suspects(&mut page, r);
    page.section("Where a misfit may come from");
    page.paragraph(
        "Each part is tested alone, to first order, with the material free: signed square root of the fall of the deviance. \
         Values within ±3 are noise.",
    );
    for (name, svg) in &pictures.maps {
        page.figure(svg, &format!("Significance of a change of the {name}."));
    }
    page
}

fn header(d: &Diagnosis, r: &DiagnosisResult) -> ReportHeader {
    ReportHeader {
        subtitle: format!("Diagnosis of recording {}", r.recording),
        program_version: r.version.clone(),
        input_hash: r.input_hash.clone(),
        seed: None,
        facts: vec![
            ("voxels compared".into(), d.observed.mask.num_voxels().to_string()),
            ("voxels that hold no displacement, left out".into(), r.num_outlying_voxels.to_string()),
            ("displacement unknowns".into(), r.num_unknowns.to_string()),
            ("equilibria solved".into(), r.num_solves.to_string()),
            (
                "noise per component".into(),
                format!(
                    "{} mm{}{}",
                    r.noise_sd_mm.map(|s| significant(s, 3)).join(", "),
                    if r.is_noise_estimated { " (estimated from the recording)" } else { "" },
                    r.noise_relative_range.map_or(String::new(), range_in_words)
                ),
            ),
            (
                "discretisation allowance".into(),
                format!("{} mm rms at the largest drive", significant(r.allowance_mm, 2)),
            ),
        ],
    }
}

/// How far the noise differs over the image.
fn range_in_words(range: [[f64; 2]; 3]) -> String {
    let of_component = |[low, high]: [f64; 2]| format!("{} to {}", significant(low, 2), significant(high, 2));
    format!("; over the image {} times as much", range.map(of_component).join(", "))
}

/// The verdict in words, and how the modulus differs from that believed.
fn verdict(page: &mut Report, r: &DiagnosisResult) {
    let names = r.causes.iter().map(|c| c.description.clone()).collect::<Vec<_>>().join("; ");
    match r.verdict {
        Verdict::NoMismatch => page.callout(
            CalloutKind::Finding,
            "No cause is named",
            "The nominal model explains the recording up to its noise and what meshes leave.",
        ),
        Verdict::Unexplained => page.callout(
            CalloutKind::Caution,
            "Something is left that no cause explains",
            &format!(
                "Misfit beyond noise: {} mm rms, most of it {}. {}",
                significant(r.structured_rms_mm.after, 2),
                r.left_at.as_ref().map_or("everywhere".into(), |l| format!("near {} mm", coordinates(l.center_mm))),
                if names.is_empty() { String::new() } else { format!("Partly explained by: {names}.") }
            ),
        ),
        Verdict::Explained => page.callout(CalloutKind::Finding, "Explained", &names),
        Verdict::ExplainedAmbiguously => page.callout(
            CalloutKind::Caution,
            "Explained, but not by one cause alone",
            &format!(
                "{names}. The data cannot tell this from: {}.",
                r.alternatives.iter().map(alternative).collect::<Vec<_>>().join("; ")
            ),
        ),
    };
    if let Some(m) = &r.modulus_against_belief {
        page.callout(CalloutKind::Caution, "Not as stiff as believed", &format!("It seems that {}.", m.in_words()));
    }
}

/// Whether the misfit was made at the boundary or inside.
fn interior(page: &mut Report, r: &DiagnosisResult) {
    let Some(test) = &r.interior else { return };
    page.subsection("Where it was made, asked before any cause");
    page.paragraph(&format!(
        "The part of the sample between two planes {} mm from its middle was driven by the displacement that was measured on them, whatever the plates and bonds did. There χ² per datum falls from {} to {}, and the misfit beyond noise from {} to {} mm rms: {}.",
        significant(test.plane_mm, 3),
        significant(test.chi2_per_datum.before, 3),
        significant(test.chi2_per_datum.after, 3),
        significant(test.structured_rms_mm.before, 2),
        significant(test.structured_rms_mm.after, 2),
        test.origin.in_words()
    ));
}

/// A cause with its place, its parameters and its evidence.
fn describe(page: &mut Report, cause: &CauseResult) {
    page.subsection(&format!("{}: {}", cause.name, cause.description));
    if let Some(l) = &cause.location {
        page.paragraph(&format!(
            "At the {}, centre {} mm, extent {} mm.",
            l.region,
            coordinates(l.center_mm),
            coordinates(l.extent_mm)
        ));
    }
    page.table(&Table {
        columns: vec![Column::words("parameter"), Column::numbers("value", ""), Column::numbers("95 % interval", "")],
        rows: cause
            .parameters
            .iter()
            .map(|p| {
                let interval = p.interval_95.map_or("not bounded by the data".into(), |[a, b]| {
                    format!("{} to {}", significant(a, 4), significant(b, 4))
                });
                vec![p.name.replace('_', " "), significant(p.value, 4), interval]
            })
            .collect(),
        note: format!(
            "Evidence {} (fall of the deviance); explains {} mm rms of displacement.",
            significant(cause.evidence, 3),
            significant(cause.effect_rms_mm, 2)
        ),
        ..Table::default()
    });
}

fn before_and_after(page: &mut Report, r: &DiagnosisResult) {
    let mut rows = vec![
        row("χ² per datum (1 is noise)", r.chi2_per_datum.before, r.chi2_per_datum.after),
        row("misfit beyond noise, mm rms", r.structured_rms_mm.before, r.structured_rms_mm.after),
    ];
    rows.extend(r.kept_back_rms_mm.as_ref().map(|k| row("misfit on blocks kept back, mm rms", k.before, k.after)));
    page.table(&Table {
        columns: vec![Column::words(""), Column::numbers("nominal model", ""), Column::numbers("with the causes", "")],
        rows,
        note: "Kept back: the fits see one colour of a chequerboard of voxel blocks and predict the other, in turn."
            .into(),
        ..Table::default()
    });
}

fn materials(page: &mut Report, d: &Diagnosis, r: &DiagnosisResult) {
    page.table(&Table {
        caption: "The material: how wrong the lab would have been".into(),
        columns: vec![
            Column::words("parameter"),
            Column::numbers("nominal model", ""),
            Column::numbers("with the causes", ""),
            Column::numbers("95 % interval", ""),
        ],
        rows: r
            .material_parameters
            .iter()
            .zip(d.corrected.material.parameters())
            .map(|(p, parameter)| {
                let has = d.nominal.material.parameters().contains(&parameter);
                let before = if has { significant(d.nominal.material.value(parameter), 4) } else { "not used".into() };
                let interval = p
                    .interval_95
                    .map_or("not bounded".into(), |[a, b]| format!("{} to {}", significant(a, 4), significant(b, 4)));
                vec![p.name.clone(), before, significant(p.value, 4), interval]
            })
            .collect(),
        ..Table::default()
    });
}

/// All suspects that were tested.
fn suspects(page: &mut Report, r: &DiagnosisResult) {
    page.table(&Table {
        columns: vec![
            Column::numbers("round", ""),
            Column::words("cause"),
            Column::words("in words"),
            Column::numbers("score", ""),
            Column::numbers("full fit", "less ln n per parameter"),
        ],
        rows: r
            .ranked
            .iter()
            .map(|c| {
                vec![
                    c.round.to_string(),
                    c.name.clone(),
                    c.description.clone(),
                    significant(c.score, 3),
                    c.fitted.map_or(String::new(), |f| significant(f, 3)),
                ]
            })
            .collect(),
        ..Table::default()
    });
}

/// An alternative in words, with the experiment that would tell it apart.
fn alternative(cause: &CauseResult) -> String {
    let experiment = cause.experiments.first().map_or(String::new(), |e| {
        let (drive, distance) = (significant(e.drive_mm, 3), significant(e.distance_sd, 2));
        format!(" (a further step at {drive} mm would tell it apart by {distance} standard deviations)")
    });
    format!("{}{experiment}", cause.description)
}

fn row(name: &str, before: f64, after: f64) -> Vec<String> {
    vec![name.into(), significant(before, 4), significant(after, 4)]
}

fn coordinates(x: [f64; 3]) -> String {
    format!("({:.1}, {:.1}, {:.1})", x[0], x[1], x[2])
}

fn verdict_words(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::NoMismatch => "No mismatch beyond noise and meshes",
        Verdict::Explained => "A mismatch, explained",
        Verdict::ExplainedAmbiguously => "A mismatch with more than one explanation",
        Verdict::Unexplained => "A mismatch that is not explained",
    }
}
