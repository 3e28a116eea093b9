//! A proof with several causes at once in tables.

use super::num;
use crate::proof::{CauseOfSeveral, SeveralProof};

pub(in crate::job) fn several(proof: &SeveralProof) -> String {
    let mut text = String::from(
        "| cause | hidden | detectable | of these named | named falsely | intervals that hold | a50, μm | a90, μm | a90/95, μm |\n|---|---|---|---|---|---|---|---|---|\n",
    );
    for cause in &proof.causes {
        text += &row(cause);
    }
    let share = |[part, whole]: [usize; 2]| {
        if whole == 0 {
            "not tried".into()
        } else {
            format!("{part}/{whole} ({} %)", num(100.0 * part as f64 / whole as f64, 4))
        }
    };
    text += &format!(
        "\nall detectable causes named: {}; false among the named: {}; harmless mounts without alarm: {}; unknown causes left unexplained: {}, located: {}; intervals that hold the truth: {}\n",
        share(proof.all_named),
        share(proof.false_of_named),
        share(proof.quiet_controls),
        share(proof.unexplained_of_unknown),
        share(proof.located_of_unknown),
        share(proof.covered)
    );
    text
}

fn row(c: &CauseOfSeveral) -> String {
    let held = if c.num_covered[1] == 0 { String::new() } else { format!("{}/{}", c.num_covered[0], c.num_covered[1]) };
    let size = |mm: Option<f64>| mm.map_or(String::new(), |mm| num(1e3 * mm, 3));
    let curve = c.detection.as_ref();
    format!(
        "| {} | {} | {} | {} | {} | {held} | {} | {} | {} |\n",
        c.cause.name(),
        c.num_hidden,
        c.num_detectable,
        c.num_named,
        c.num_false,
        size(curve.map(|d| d.a50_mm)),
        size(curve.map(|d| d.a90_mm)),
        size(curve.and_then(|d| d.a90_95_mm))
    )
}
