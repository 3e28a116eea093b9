//! Diagnoses as text.

use super::num;
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
        text += &format!(
            "\ninterior test: chi2 per datum {} -> {} between the planes: {words}\n",
            num(before, 5),
            num(after, 5)
        );
    }
    for c in &r.causes {
        text += &format!("\n{} ({:?}): {}\n", c.name, c.category, c.description);
        for p in &c.parameters {
            let interval = p
                .interval_95
                .map_or("not bounded by the data".into(), |[a, b]| format!("{} to {}", num(a, 5), num(b, 5)));
            text += &format!("  {:<40} {:>10}   {interval}\n", p.name, num(p.value, 5));
        }
        if let Some(l) = &c.location {
            text += &format!("  at the {}: centre {:.1?} mm, extent {:.1?} mm\n", l.region, l.center_mm, l.extent_mm);
        }
        text += &format!("  evidence {}, explains {} mm rms\n", num(c.evidence, 4), num(c.effect_rms_mm, 5));
        text += &format!("  what can be done: {}\n", c.remedy);
    }
    for c in &r.alternatives {
        let what =
            if r.verdict == Verdict::Unexplained { "tried, and no explanation" } else { "not told apart from it" };
        text += &format!("\n{what}: {} ({})\n", c.name, c.description);
        if let Some(e) = c.experiments.first() {
            text += &format!(
                "  a further step at {} mm would tell it apart by {} standard deviations\n",
                num(e.drive_mm, 5),
                num(e.distance_sd, 4)
            );
        }
    }
    text += &format!(
        "\nchi2 per datum      {} -> {}\nmisfit beyond noise {} -> {} mm rms (allowance {})\n",
        num(r.chi2_per_datum.before, 5),
        num(r.chi2_per_datum.after, 5),
        num(r.structured_rms_mm.before, 5),
        num(r.structured_rms_mm.after, 5),
        num(r.allowance_mm, 5)
    );
    if let Some(kept_back) = &r.kept_back_rms_mm {
        let [before, after] = [kept_back.before, kept_back.after].map(|rms| num(rms, 5));
        text += &format!("kept back           {before} -> {after} mm rms\n");
    }
    if let Some(m) = &r.modulus_against_belief {
        text += &format!("\n{}\n", m.in_words());
    }
    text += "\nmaterial            nominal model -> with the causes\n";
    for p in d.corrected.material.parameters() {
        let before =
            if d.nominal.material.parameters().contains(&p) { num(d.nominal.material.value(p), 4) } else { "-".into() };
        let (name, value) = (p.name(), d.corrected.material.value(p));
        let interval = r.material_parameters.iter().find(|m| m.name == name).and_then(|m| m.interval_95);
        // Two standard deviations to each side: one of them is more than the value.
        let is_unknown = interval.is_none_or(|[low, high]| high - low > 4.0 * value.abs());
        let note = if is_unknown { "   not identifiable" } else { "" };
        text += &format!("  {name:<10} {before:>12} -> {}{note}\n", num(value, 4));
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
                format!("{} {} ± {}", p.name, num(p.value, 4), num(half, 4))
            })
            .collect();
        text += &format!("  {:<18} {:?} [{}]; {}\n", r.recording, r.verdict, causes.join(", "), parameters.join(", "));
    }
    let Some(found) = found else { return text };
    text += &format!("\none material for all: {}\n", in_words(&found.one_material));
    for p in &found.material_parameters {
        let interval =
            p.interval_95.map_or("not bounded by the data".into(), |[a, b]| format!("{} to {}", num(a, 5), num(b, 5)));
        text += &format!("  {:<40} {:>10}   {interval}\n", p.name, num(p.value, 5));
    }
    for c in &found.common_causes {
        text += &format!("\none size for all of '{}': {}\n", c.description, in_words(&c.agreement));
        for p in &c.parameters {
            let interval = p
                .interval_95
                .map_or("not bounded by the data".into(), |[a, b]| format!("{} to {}", num(a, 5), num(b, 5)));
            text += &format!("  {:<40} {:>10}   {interval}\n", p.name, num(p.value, 5));
        }
    }
    text += "\npredicted by each other  mm rms and largest error of a force: nominal -> with the causes\n";
    for p in &found.predictions {
        let displacement = p
            .displacement_rms_mm
            .map_or("no equilibrium".into(), |b| format!("{} -> {}", num(b.before, 5), num(b.after, 5)));
        let force = p
            .force_relative
            .map_or("no force".into(), |b| format!("{} -> {} %", num(100.0 * b.before, 4), num(100.0 * b.after, 4)));
        text += &format!("  {:<18} by {:<18} {displacement}; {force}\n", p.to, p.from);
        let chi2 = |b: BeforeAfter| format!("{} -> {}", num(b.before, 4), num(b.after, 4));
        if let Some(plain) = p.chi2_per_datum {
            let with = |own: &str, b: Option<BeforeAfter>| {
                b.map_or(String::new(), |b| format!("; with the plates' {own} at each step fitted {}", chi2(b)))
            };
            let shifts = with("shifts", p.chi2_per_datum_with_own_shifts);
            let motions = with("shifts and rotations", p.chi2_per_datum_with_own_motions);
            text += &format!("  {:<18}    chi2 per datum {}{shifts}{motions}\n", "", chi2(plain));
        }
    }
    text
}
