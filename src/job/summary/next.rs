//! The next scan as text.

use super::num;
use crate::next::NextResult;

/// The result as text: a sentence first, then a table.
pub(in crate::job) fn next(result: &NextResult) -> String {
    let mut text = format!("{}\n\nknown so far from {}\n", result.sentence, result.recordings.join(", "));
    for p in &result.parameters {
        let [low, high] = p.interval_95.map(|end| num(end, 4));
        let [sd, mesh] = [p.relative_sd, p.discretisation_relative_sd].map(|sd| num(100.0 * sd, 3));
        text += &format!(
            "  {:<10} {:>10}, sd {sd} %, by the mesh {mesh} %, 95 % interval {low} to {high}\n",
            p.name,
            num(p.value, 5)
        );
    }
    text += "\nsd after the scan, %";
    for p in &result.parameters {
        text += &format!(" {:>9}", p.name);
    }
    text += "   minutes   gain/minute   gain of all";
    let is_asked = result.stop.is_some();
    text += if is_asked { "   scans needed\n" } else { "\n" };
    for c in &result.candidates {
        text += &format!("  {}\n{:>20}", c.name, "");
        for sd in &c.promised_relative_sd {
            text += &format!(" {:>9}", num(100.0 * sd, 3));
        }
        text += &format!("   {:>7}   {:>11}   {:>11}", c.minutes, num(c.gain_per_minute, 3), num(c.gain_of_all, 3));
        let scans = c.num_scans_to_precision.map_or("never enough".into(), |n| n.to_string());
        text += &if is_asked { format!("   {scans:>12}\n") } else { "\n".into() };
    }
    for l in &result.left_out {
        text += &format!("  {}: left out, {}\n", l.name, l.reason);
    }
    for note in &result.notes {
        text += &format!("note: {note}\n");
    }
    text
}
