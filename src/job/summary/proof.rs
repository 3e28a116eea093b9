//! A proof of the diagnosis as a table in Markdown.

use super::num;
use crate::proof::{CauseSummary, Proof, Scored};

pub(in crate::job) fn proof(proof: &Proof) -> String {
    let mut text = String::from(
        "| hidden | recordings | detectable | right | right of detectable | right, nothing left | nothing named | place, mm (median) | intervals that hold | named first |\n|---|---|---|---|---|---|---|---|---|---|\n",
    );
    let row = |k: &CauseSummary, note: &str| {
        let place = k.median_location_error_mm.map_or(String::new(), |x| num(x, 4));
        let held =
            if k.num_covered[1] == 0 { String::new() } else { format!("{}/{}", k.num_covered[0], k.num_covered[1]) };
        let named: Vec<String> = k.first_named.iter().map(|(n, c)| format!("{n} {c}")).collect();
        format!(
            "| {}{note} | {} | {} | {} | {} | {} | {} | {place} | {held} | {} |\n",
            k.cause.name(),
            k.num_recordings,
            k.num_detectable,
            k.num_right,
            k.num_right_detectable,
            k.num_right_explained,
            k.num_silent,
            named.join(", ")
        )
    };
    for k in &proof.known {
        text += &row(k, "");
    }
    for k in &proof.unknown {
        text += &row(k, " (not in the registry)");
    }
    text += "\n| effect on the displacement, mm rms | recordings with a cause in the displacement | cause first |\n|---|---|---|\n";
    let edges = [0.0, 0.007, 0.014, 0.021, 0.035, 0.07, 0.14, f64::INFINITY];
    for pair in edges.windows(2) {
        let within: Vec<&Scored> = proof
            .scored
            .iter()
            .filter(|s| s.is_known && s.hidden.cause.acts_on_displacement())
            .filter(|s| s.effect_rms_mm >= pair[0] && s.effect_rms_mm < pair[1])
            .collect();
        let right = within.iter().filter(|s| s.is_right).count();
        text += &format!("| {} to {} | {} | {right} |\n", pair[0], pair[1], within.len());
    }
    let percent = |x: f64| if x.is_finite() { format!("{} %", num(100.0 * x, 4)) } else { "not tried".into() };
    text += &format!(
        "\ncause first, of the detectable: {}; false alarms: {}; unknown causes called unexplained, of the detectable: {}; intervals that hold the truth: {}\n",
        percent(proof.right_of_detectable),
        percent(proof.false_alarm_rate),
        percent(proof.unexplained_of_unknown),
        percent(proof.interval_coverage)
    );
    text
}
