//! Comparisons as text, Markdown and JUnit XML.

use super::figure::{Judgement, Line};
use super::verdict::Comparison;
use crate::field::escape_xml;

/// Lines shown per comparison in text and Markdown; the JSON has all.
const MAX_LINES: usize = 40;

fn word(j: Judgement) -> &'static str {
    match j {
        Judgement::Same => "same",
        Judgement::Better => "better",
        Judgement::Changed => "changed",
        Judgement::Worse => "worse",
    }
}

fn number(value: Option<f64>) -> String {
    value.map_or("none".into(), |v| crate::report::significant(v, 6))
}

fn percent(line: &Line) -> String {
    line.relative_change.map_or("-".into(), |c| {
        let p = 100.0 * c;
        if p.abs() < 0.01 { format!("{p:+.1e} %") } else { format!("{p:+.2} %") }
    })
}

fn counts(c: &Comparison) -> String {
    format!("{} same, {} better, {} changed, {} worse", c.num_same, c.num_better, c.num_changed, c.num_worse)
}

/// A table per comparison.
pub fn to_text(comparisons: &[Comparison]) -> String {
    let mut text = String::new();
    for c in comparisons {
        text += &format!("{} ({}): {}\n", c.name, c.kind, counts(c));
        for note in &c.notes {
            text += &format!("  note: {note}\n");
        }
        if !c.differences.is_empty() {
            text += &format!("  {:<62} {:>13} {:>13} {:>11}  judgement\n", "figure", "base", "current", "change");
        }
        for l in c.differences.iter().take(MAX_LINES) {
            let (base, current) = (number(l.base), number(l.current));
            text += &format!("  {:<62} {base:>13} {current:>13} {:>11}  {}\n", l.figure, percent(l), word(l.judgement));
        }
        if c.differences.len() > MAX_LINES {
            text += &format!("  and {} more (--json lists all)\n", c.differences.len() - MAX_LINES);
        }
    }
    text
}

/// A summary for a pull request.
pub fn to_markdown(comparisons: &[Comparison]) -> String {
    let mut text = String::from(
        "## Comparison of results\n\n| result | same | better | changed | worse |\n|---|--:|--:|--:|--:|\n",
    );
    for c in comparisons {
        let name = escape_markdown(&c.name);
        text += &format!("| {name} | {} | {} | {} | {} |\n", c.num_same, c.num_better, c.num_changed, c.num_worse);
    }
    for c in comparisons.iter().filter(|c| !c.differences.is_empty() || !c.notes.is_empty()) {
        text += &format!("\n### {}\n\n", escape_markdown(&c.name));
        for note in &c.notes {
            text += &format!("* {}\n", escape_markdown(note));
        }
        if c.differences.is_empty() {
            continue;
        }
        text += "\n| figure | base | current | change | judgement |\n|---|--:|--:|--:|---|\n";
        for l in c.differences.iter().take(MAX_LINES) {
            let (figure, base, current) = (escape_markdown(&l.figure), number(l.base), number(l.current));
            text += &format!("| {figure} | {base} | {current} | {} | {} |\n", percent(l), word(l.judgement));
        }
        if c.differences.len() > MAX_LINES {
            text += &format!("\nand {} more\n", c.differences.len() - MAX_LINES);
        }
    }
    text
}

fn escape_markdown(text: &str) -> String {
    text.replace('|', "\\|").replace('<', "&lt;").replace('\n', " ")
}

/// JUnit XML: a test case per comparison, failed where the current result is worse.
pub fn to_junit(comparisons: &[Comparison]) -> String {
    let failures = comparisons.iter().filter(|c| c.is_worse).count();
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites tests=\"{n}\" failures=\"{failures}\">\n\
         <testsuite name=\"lambdak compare\" tests=\"{n}\" failures=\"{failures}\" errors=\"0\" skipped=\"0\">\n",
        n = comparisons.len()
    );
    for c in comparisons {
        let (name, kind) = (escape_xml(&c.name), escape_xml(&c.kind));
        text += &format!("<testcase classname=\"{kind}\" name=\"{name}\"");
        if c.is_worse {
            let body = escape_xml(&to_text(std::slice::from_ref(c)));
            text += &format!(">\n<failure message=\"{}\">{body}</failure>\n</testcase>\n", escape_xml(&counts(c)));
        } else {
            text += "/>\n";
        }
    }
    text + "</testsuite>\n</testsuites>\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::{Direction, Figure};

    fn comparison(is_worse: bool) -> Comparison {
        let figure =
            Figure { name: "a < b & \"c\" | d".into(), value: Some(2.0), direction: Direction::LargerIsBetter };
        let line = Line::new(&figure, Some(if is_worse { 1.0 } else { 3.0 }), 1e-6);
        Comparison {
            name: "two <holes>".into(),
            kind: "evaluation/1".into(),
            num_same: 4,
            num_better: usize::from(!is_worse),
            num_changed: 0,
            num_worse: usize::from(is_worse),
            is_worse,
            notes: vec![],
            differences: vec![line],
        }
    }

    #[test]
    fn junit_counts_failures_and_escapes() {
        let xml = to_junit(&[comparison(true), comparison(false)]);
        assert!(xml.contains("tests=\"2\" failures=\"1\""));
        assert!(xml.contains("two &lt;holes&gt;") && xml.contains("a &lt; b &amp; &quot;c&quot;"));
        assert_eq!(xml.matches("<failure").count(), 1);
    }

    #[test]
    fn text_and_markdown_show_what_changed() {
        let text = to_text(&[comparison(true)]);
        assert!(text.contains("-50.00 %") && text.contains("worse"), "{text}");
        let markdown = to_markdown(&[comparison(false)]);
        assert!(markdown.contains("a &lt; b & \"c\" \\| d") && markdown.contains("+50.00 %"), "{markdown}");
    }
}
