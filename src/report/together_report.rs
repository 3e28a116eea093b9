//! The report of several diagnoses together: their materials beside the common one, agreement, cross-predictions.

use super::bars::{BarGroup, GroupedBars};
use super::html::{Report, ReportHeader};
use super::html_parts::{CalloutKind, Column, Table};
use super::lines::{Line, LinePlot};
use super::number::significant;
use crate::diagnosis::{Agreement, BeforeAfter, DiagnosisResult, TogetherResult};
use crate::homogeneous::{HomogeneousTest, incompressible_stress};
use crate::material::Material;
use crate::specimen::{Specimen, TestKind};

/// Points per curve.
const NUM_POINTS: usize = 41;

/// Pictures of several diagnoses: file name without ending, SVG.
pub fn together_pictures(t: &TogetherResult, all: &[&DiagnosisResult], specimen: &Specimen) -> Vec<(String, String)> {
    vec![("materials".into(), materials(t, all, specimen)), ("cross-predictions".into(), predictions(t))]
}

/// The page.
pub fn together_report(t: &TogetherResult, all: &[&DiagnosisResult], specimen: &Specimen) -> Report {
    let header = ReportHeader {
        subtitle: format!("{} recordings together", all.len()),
        program_version: all.first().map_or(String::new(), |r| r.version.clone()),
        input_hash: all.first().map_or(String::new(), |r| r.input_hash.clone()),
        seed: None,
        facts: vec![("recordings".into(), all.iter().map(|r| r.recording.clone()).collect::<Vec<_>>().join(", "))],
    };
    let title = if t.one_material.agrees { "One material serves all" } else { "No one material serves all" };
    let mut page = Report::new(title, header);
    let kind = if t.one_material.agrees { CalloutKind::Finding } else { CalloutKind::Caution };
    page.callout(kind, title, &in_words(&t.one_material));
    page.table(&Table {
        caption: "The recordings".into(),
        columns: vec![Column::words("recording"), Column::words("causes"), Column::words("material with the causes")],
        rows: all
            .iter()
            .map(|r| {
                let causes: Vec<&str> = r.causes.iter().map(|c| &*c.name).collect();
                let parameters: Vec<String> =
                    r.material_parameters.iter().map(|p| format!("{} {}", p.name, significant(p.value, 4))).collect();
                vec![r.recording.clone(), causes.join(", "), parameters.join(", ")]
            })
            .collect(),
        ..Table::default()
    });
    page.table(&Table {
        caption: "The one material".into(),
        columns: vec![Column::words("parameter"), Column::numbers("value", ""), Column::numbers("95 % interval", "")],
        rows: t
            .material_parameters
            .iter()
            .map(|p| {
                let interval = p
                    .interval_95
                    .map_or("not bounded".into(), |[a, b]| format!("{} to {}", significant(a, 4), significant(b, 4)));
                vec![p.name.clone(), significant(p.value, 4), interval]
            })
            .collect(),
        ..Table::default()
    });
    let pictures = together_pictures(t, all, specimen);
    page.figure(
        &pictures[0].1,
        "Shear or tension of the materials (incompressible), up to the mean strain of the largest drive.",
    );
    if !t.common_causes.is_empty() {
        page.table(&Table {
            caption: "Causes named in every recording".into(),
            columns: vec![Column::words("cause"), Column::words("one size for all"), Column::words("its parameters")],
            rows: t
                .common_causes
                .iter()
                .map(|c| {
                    let values: Vec<String> =
                        c.parameters.iter().map(|p| format!("{} {}", p.name, significant(p.value, 4))).collect();
                    vec![c.description.clone(), in_words(&c.agreement), values.join(", ")]
                })
                .collect(),
            ..Table::default()
        });
    }
    page.figure(
        &pictures[1].1,
        "Every recording predicted by every other: nominal model and with the causes. Noise is included.",
    );
    let pair = |b: Option<BeforeAfter>, scale: f64, missing: &str| {
        b.map_or(missing.into(), |b| {
            format!("{} to {}", significant(scale * b.before, 3), significant(scale * b.after, 3))
        })
    };
    page.table(&Table {
        columns: vec![
            Column::words("predicted"),
            Column::words("by the fit to"),
            Column::numbers("mm rms, nominal to with causes", ""),
            Column::numbers("force, %", ""),
            Column::numbers("χ² per datum", ""),
            Column::numbers("χ², plates' shifts fitted", ""),
            Column::numbers("χ², shifts and rotations fitted", ""),
        ],
        rows: t
            .predictions
            .iter()
            .map(|p| {
                vec![
                    p.to.clone(),
                    p.from.clone(),
                    pair(p.displacement_rms_mm, 1.0, "no equilibrium"),
                    pair(p.force_relative, 100.0, "none"),
                    pair(p.chi2_per_datum, 1.0, "no equilibrium"),
                    pair(p.chi2_per_datum_with_own_shifts, 1.0, "not asked"),
                    pair(p.chi2_per_datum_with_own_motions, 1.0, "not asked"),
                ]
            })
            .collect(),
        ..Table::default()
    });
    page
}

/// Whether recordings agree, with the numbers.
pub fn in_words(a: &Agreement) -> String {
    format!(
        "{}: the deviance rises by {} where {} parameters are saved; {} would be too much",
        if a.agrees { "yes" } else { "no" },
        significant(a.deviance_rise, 3),
        a.parameters_saved,
        significant(a.deviance_limit, 3)
    )
}

fn materials(t: &TogetherResult, all: &[&DiagnosisResult], specimen: &Specimen) -> String {
    let drive = specimen.largest_drive_mm().abs();
    let (test, strain, x_label) = match specimen.test {
        TestKind::DoubleLapShear => (HomogeneousTest::SimpleShear, drive / specimen.block.thickness_mm, "shear (1)"),
        TestKind::Uniaxial => (HomogeneousTest::Uniaxial, drive / specimen.block.length_mm, "stretch (1)"),
    };
    let curve = |material: &Material| -> Vec<[f64; 2]> {
        let terms = material.shear_terms();
        (0..NUM_POINTS)
            .map(|i| {
                let at = test.rest() + strain * i as f64 / (NUM_POINTS - 1) as f64;
                [at, incompressible_stress(&terms, &test.at(at))]
            })
            .collect()
    };
    let line = |name: &str, material: &Material| Line { name: name.into(), points: curve(material), ..Line::default() };
    let mut lines: Vec<Line> = all.iter().map(|r| line(&r.recording, &r.material)).collect();
    lines.push(line("one for all", &t.material));
    LinePlot {
        title: "Materials with the causes taken into account".into(),
        x_label: x_label.into(),
        y_label: "nominal stress (kPa)".into(),
        is_log: false,
        lines,
    }
    .to_svg()
}

/// How many bytes all names start with alike; a few are not worth cutting off.
fn common_start(names: &[&str]) -> usize {
    let Some(first) = names.first() else { return 0 };
    let mut ends = first.char_indices().map(|(i, c)| i + c.len_utf8());
    let alike = ends.rfind(|&end| names.iter().all(|n| n.get(..end) == first.get(..end) && n.len() > end));
    alike.filter(|end| *end > 4).unwrap_or(0)
}

fn predictions(t: &TogetherResult) -> String {
    let names: Vec<&str> = t.predictions.iter().flat_map(|p| [&*p.from, &*p.to]).collect();
    let start = common_start(&names);
    let groups = t
        .predictions
        .iter()
        .map(|p| {
            let [to, from] = [&p.to, &p.from].map(|name| &name[start..]);
            let label = if p.from == p.to { format!("{to}, own fit") } else { format!("{to} by {from}") };
            let values = p.displacement_rms_mm.map_or(vec![f64::NAN; 2], |b| vec![b.before, b.after]);
            BarGroup { label, values }
        })
        .collect();
    GroupedBars {
        title: "Misfit of recordings predicted by each other".into(),
        axis_label: "mm rms".into(),
        series: vec!["nominal material".into(), "with the causes".into()],
        groups,
        is_log: false,
        reference: None,
        missing_label: "no equilibrium".into(),
    }
    .to_svg()
}

#[cfg(test)]
mod tests {
    use super::common_start;

    #[test]
    fn names_are_cut_where_they_differ() {
        assert_eq!(common_start(&["block-5mm-a", "block-5mm-b"]), 10);
        // One name starts as the other: something must be left of it.
        assert_eq!(common_start(&["block-5mm", "block-5mm-b"]), 8);
        assert_eq!(common_start(&["ab1", "ab2"]), 0);
        assert_eq!(common_start(&["Größe-α", "Größe-β"]), 8);
        assert_eq!(common_start(&[]), 0);
    }
}
