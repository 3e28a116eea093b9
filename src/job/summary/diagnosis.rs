//! Diagnoses as text.

use crate::diagnosis::{BeforeAfter, Diagnosis, DiagnosisResult, TogetherResult, Verdict};
use crate::report::in_words;

pub(in crate::job) fn diagnosis(r: &DiagnosisResult, d: &Diagnosis) -> String {
    let verdict = match r.verdict {
        Verdict::NoMismatch => "no mismatch beyond noise and meshes",
        Verdict::Explained => "explained",
        Verdict::ExplainedAmbiguously => "explained, but not by one cause alone",
        Verdict::Unexplained => "unexplained: something is left that no cause in the registry explains",
    };
    let mut text = format!("{}: {verdict}\n", r.recording);
    if r.num_outlying_voxels > 0 {
        text += &format!("{} voxels hold no displacement and are left out\n", r.num_outlying_voxels);
    }
    if let Some(test) = &r.interior {
        let (before, after) = (test.chi2_per_datum.before, test.chi2_per_datum.after);
        let words = test.origin.in_words();
        text += &format!("\ninterior test: chi2 per datum {before:.4} -> {after:.4} between the planes: {words}\n");
    }
    for c in &r.causes {
        text += &format!("\n{} ({:?}): {}\n", c.name, c.category, c.description);
        for p in &c.parameters {
            let interval = p.interval_95.map_or("not bounded by the data".into(), |[a, b]| format!("{a:.4} to {b:.4}"));
            text += &format!("  {:<40} {:>10.4}   {interval}\n", p.name, p.value);
        }
        if let Some(l) = &c.location {
            text += &format!("  at the {}: centre {:.1?} mm, extent {:.1?} mm\n", l.region, l.center_mm, l.extent_mm);
        }
        text += &format!("  evidence {:.0}, explains {:.4} mm rms\n", c.evidence, c.effect_rms_mm);
        text += &format!("  what can be done: {}\n", c.remedy);
    }
    for c in &r.alternatives {
        let what =
            if r.verdict == Verdict::Unexplained { "tried, and no explanation" } else { "not told apart from it" };
        text += &format!("\n{what}: {} ({})\n", c.name, c.description);
        if let Some(e) = c.experiments.first() {
            text += &format!(
                "  a further step at {:.2} mm would tell it apart by {:.1} standard deviations\n",
                e.drive_mm, e.distance_sd
            );
        }
    }
    text += &format!(
        "\nchi2 per datum      {:.4} -> {:.4}\nmisfit beyond noise {:.4} -> {:.4} mm rms (allowance {:.4})\nkept back           {:.4} -> {:.4} mm rms\n",
        r.chi2_per_datum.before,
        r.chi2_per_datum.after,
        r.structured_rms_mm.before,
        r.structured_rms_mm.after,
        r.allowance_mm,
        r.kept_back_rms_mm.before,
        r.kept_back_rms_mm.after
    );
    if let Some(m) = &r.modulus_against_belief {
        text += &format!("\n{}\n", m.in_words());
    }
    text += "\nmaterial            nominal model -> with the causes\n";
    for p in d.corrected.material.parameters() {
        let before = if d.nominal.material.parameters().contains(&p) {
            format!("{:.3}", d.nominal.material.value(p))
        } else {
            "-".into()
        };
        text += &format!("  {:<10} {before:>12} -> {:.3}\n", p.name(), d.corrected.material.value(p));
    }
    text
}

/// Whether the recordings agree: causes of each, materials side by side, the one material, and what each says of the
/// others.
pub(in crate::job) fn together(results: &[&DiagnosisResult], found: Option<&TogetherResult>) -> String {
    let mut text = String::from("all recordings        verdict, causes; material with the causes\n");
    for r in results {
        let causes: Vec<&str> = r.causes.iter().map(|c| &*c.name).collect();
        let parameters: Vec<String> = r
            .material_parameters
            .iter()
            .map(|p| {
                let half = p.interval_95.map_or(f64::NAN, |[a, b]| 0.5 * (b - a));
                format!("{} {:.3} ± {:.3}", p.name, p.value, half)
            })
            .collect();
        text += &format!("  {:<18} {:?} [{}]; {}\n", r.recording, r.verdict, causes.join(", "), parameters.join(", "));
    }
    let Some(found) = found else { return text };
    text += &format!("\none material for all: {}\n", in_words(&found.one_material));
    for p in &found.material_parameters {
        let interval = p.interval_95.map_or("not bounded by the data".into(), |[a, b]| format!("{a:.4} to {b:.4}"));
        text += &format!("  {:<40} {:>10.4}   {interval}\n", p.name, p.value);
    }
    for c in &found.common_causes {
        text += &format!("\none size for all of '{}': {}\n", c.description, in_words(&c.agreement));
        for p in &c.parameters {
            let interval = p.interval_95.map_or("not bounded by the data".into(), |[a, b]| format!("{a:.4} to {b:.4}"));
            text += &format!("  {:<40} {:>10.4}   {interval}\n", p.name, p.value);
        }
    }
    text += "\npredicted by each other  mm rms and largest error of a force: nominal -> with the causes\n";
    for p in &found.predictions {
        let displacement =
            p.displacement_rms_mm.map_or("no equilibrium".into(), |b| format!("{:.4} -> {:.4}", b.before, b.after));
        let force = p
            .force_relative
            .map_or("no force".into(), |b| format!("{:.2} -> {:.2} %", 100.0 * b.before, 100.0 * b.after));
        text += &format!("  {:<18} by {:<18} {displacement}; {force}\n", p.to, p.from);
        let chi2 = |b: BeforeAfter| format!("{:.1} -> {:.1}", b.before, b.after);
        if let Some(plain) = p.chi2_per_datum {
            let own = p
                .chi2_per_datum_with_own_motions
                .map_or(String::new(), |b| format!("; with the plates' motions at each step fitted {}", chi2(b)));
            text += &format!("  {:<18}    chi2 per datum {}{own}\n", "", chi2(plain));
        }
    }
    text
}
