//! Writes one of every picture and a page with all of them, to look at: `lambdak-gallery` in the temporary folder.

use super::test_xml::assert_well_formed;
use super::*;

fn page(pictures: &[(&str, String)]) -> Report {
    let header = ReportHeader {
        subtitle: "Two-hole double-lap shear specimen, one scan at 7 mm, two material priors".into(),
        program_version: "0.1.0".into(),
        input_hash: "9f2c5e0c7d".into(),
        seed: Some(42),
        facts: vec![("study".into(), "geometries/studies/two-hole-shear.json".into())],
    };
    let mut report = Report::new("A better specimen", header);
    report.section("Summary").paragraph(
        "The chosen specimen has three holes along the thickness. At the same drive it tells 1.87 times as much about \
         α₁ as the base specimen and stays within every limit.",
    );
    report.callout(
        CalloutKind::Finding,
        "Holes help here",
        "They raise the stretch between them, where a scan with this noise still resolves it.",
    );
    report.callout(CalloutKind::Caution, "The two measures disagree", "By Fisher information the solid block is the better specimen for one-term materials: a removed voxel is a lost measurement.");
    report.table(&Table {
        caption: "Chosen designs".into(),
        columns: vec![
            Column::words("design"),
            Column::numbers("objective", ""),
            Column::numbers("sd of μ₁", "kPa"),
            Column::numbers("force", "N"),
            Column::words("closest limit"),
        ],
        rows: vec![
            vec!["1".into(), "1.87".into(), "0.110".into(), "9.20".into(), "largest drive".into()],
            vec!["2".into(), "1.74".into(), "0.132".into(), "10.4".into(), "ligament hole 1 – hole 2".into()],
            vec!["base".into(), "1.00".into(), "0.220".into(), "10.5".into(), "largest drive".into()],
        ],
        emphasised_rows: vec![0],
        note: "Standard deviations are what the Fisher information promises for one scan.".into(),
    });
    report.section("Pictures");
    for (name, svg) in pictures {
        report.figure(svg, &format!("Example of {name}."));
    }
    report.section("Method").callout(
        CalloutKind::Note,
        "How it was done",
        "Coarse meshes to explore, fine ones to confirm.",
    );
    report.verbatim("{ \"schema\": \"specimen/1\" }");
    report
}

#[test]
fn the_gallery_is_written_and_well_formed() {
    let pictures = [
        ("density", density::tests::sample(3).to_svg()),
        ("density-rows", density::tests::sample(6).to_svg()),
        ("maps", maps::tests::sample().to_svg()),
        ("bars", bars::tests::sample(false).to_svg()),
        ("bars-log", bars::tests::sample(true).to_svg()),
        ("pareto", pareto::tests::sample().to_svg()),
        ("history", history::tests::sample().to_svg()),
        ("spread", spread::tests::sample().to_svg()),
        ("correlation", correlation::tests::sample().to_svg()),
        ("shape", shape::tests::sample().to_svg()),
        ("limits", limits::tests::sample(false).to_svg()),
        ("limits-broken", limits::tests::sample(true).to_svg()),
        ("ranking", ranking::tests::sample().to_svg()),
        ("placeholder", ParetoPlot { title: "Information against force".into(), ..ParetoPlot::default() }.to_svg()),
    ];
    let folder = std::env::temp_dir().join("lambdak-gallery");
    std::fs::create_dir_all(&folder).expect("temporary folder");
    for (name, svg) in &pictures {
        std::fs::write(folder.join(format!("{name}.svg")), svg).expect("written");
    }
    let report = page(&pictures);
    assert_well_formed(&report.to_html());
    report.write(&folder.join("report.html")).expect("written");
    for (name, kind) in [("hex", crate::mesh::ElementKind::Hex27), ("prism", crate::mesh::ElementKind::Prism21)] {
        let mesh = vtu::tests::row_of_cells(kind, 3);
        let mut vtu = Vtu::new(&mesh).expect("valid mesh");
        vtu.point_vectors("displacement_mm", &mesh.nodes).expect("fits");
        vtu.cell_scalars("jacobian", &[1.0, 2.0, 3.0]).expect("fits");
        vtu.cell_tensors("cauchy_stress_kpa", &[[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]]; 3]).expect("fits");
        vtu.write(&folder.join(format!("{name}.vtu"))).expect("written");
    }
}

/// Two values out of these, everywhere: no picture panics, and none holds a number that is not one.
#[test]
fn no_value_breaks_a_picture() {
    let values = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, -1.0, 1.0, 1e-320, 1e300, f64::MAX, f64::MIN];
    let name = || "a <b> & \"c\"".to_string();
    for a in values {
        for b in values {
            for flag in [false, true] {
                let mut density = density::tests::sample(1);
                density.stretch_range = [1.0, a];
                density.panels[0].density[5] = b;
                density.panels[0].median_stretch = Some(b);
                let field = VoxelField {
                    title: name(),
                    values: vec![a, b],
                    range: flag.then_some([a, b]),
                    ..VoxelField::default()
                };
                let maps =
                    VoxelMaps { shape: [2, 1, 1], origin_mm: [0.0; 3], voxel_mm: [1.0, 1.0, 2.0], fields: vec![field] };
                let bars = GroupedBars {
                    title: name(),
                    series: vec![name(), name()],
                    groups: vec![BarGroup { label: name(), values: vec![a, b] }],
                    is_log: flag,
                    reference: Some(b),
                    ..GroupedBars::default()
                };
                let points = [PointKind::Best, PointKind::Front]
                    .map(|kind| [[a, b], [b, a]].map(|[x, y]| ParetoPoint { x, y, label: name(), kind }))
                    .concat();
                let pareto =
                    ParetoPlot { title: name(), is_log_x: flag, is_log_y: flag, points, ..ParetoPlot::default() };
                let points = [a, b].map(|value| HistoryPoint { value, is_feasible: flag, phase: name() }).to_vec();
                let history =
                    HistoryPlot { title: name(), is_log: flag, base: Some(a), points, ..HistoryPlot::default() };
                let row = SpreadRow { truth: a, found: vec![a, b, 1.0], promised_sd: b, ..SpreadRow::default() };
                let spread = SpreadPlot { title: name(), rows: vec![row] };
                let values = vec![a, b, a, b];
                let correlation = CorrelationPlot { title: name(), labels: vec![name(), name()], values };
                let bar =
                    LimitBar { name: name(), value: a, limit: b, margin_relative: a, is_satisfied: flag, unit: name() };
                let limits = LimitsPlot {
                    title: name(),
                    limits: vec![bar, LimitBar { margin_relative: b, ..LimitBar::default() }],
                };
                let item = RankedItem { label: name(), left: a, right: b, is_base: flag, is_best: !flag };
                let ranking = RankingPlot { title: name(), items: vec![item.clone(), item], ..RankingPlot::default() };
                let mut shape = shape::tests::sample();
                shape.quads.truncate(2);
                shape.quads[0].value = a;
                shape.quads[1].value = b;
                shape.quads[1].current[0] = [a, b, a];
                for svg in [
                    density.to_svg(),
                    maps.to_svg(),
                    bars.to_svg(),
                    pareto.to_svg(),
                    history.to_svg(),
                    spread.to_svg(),
                    correlation.to_svg(),
                    limits.to_svg(),
                    ranking.to_svg(),
                    shape.to_svg(),
                ] {
                    assert_well_formed(&svg);
                }
            }
        }
    }
}
