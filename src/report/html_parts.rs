//! Parts of the page: tables, callouts, figures, and their style.

use super::base64::encode;
use crate::field::escape_xml;

/// Alignment of a column.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Align {
    /// Numbers.
    #[default]
    Right,
    /// Words.
    Left,
}

/// Heading of a column.
#[derive(Clone, Debug, Default)]
pub struct Column {
    /// What the column holds.
    pub heading: String,
    /// Unit of its numbers, in a line of its own; may be empty.
    pub unit: String,
    /// Alignment.
    pub align: Align,
}

impl Column {
    /// A right-aligned column of numbers.
    pub fn numbers(heading: impl Into<String>, unit: impl Into<String>) -> Self {
        Column { heading: heading.into(), unit: unit.into(), align: Align::Right }
    }

    /// A left-aligned column of words.
    pub fn words(heading: impl Into<String>) -> Self {
        Column { heading: heading.into(), unit: String::new(), align: Align::Left }
    }
}

/// A table. Cells are texts, formatted by the caller (see [`super::significant`]).
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// Caption above; may be empty.
    pub caption: String,
    /// The columns.
    pub columns: Vec<Column>,
    /// The rows; missing cells stay empty, surplus ones are dropped.
    pub rows: Vec<Vec<String>>,
    /// Rows to emphasise, by index.
    pub emphasised_rows: Vec<usize>,
    /// Remark below; may be empty.
    pub note: String,
}

/// Tone of a callout.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CalloutKind {
    /// What was found.
    #[default]
    Finding,
    /// What to be careful about.
    Caution,
    /// How it was done.
    Note,
}

impl Table {
    pub(super) fn to_html(&self) -> String {
        let mut out = String::from("<div class=\"table\">\n<table>\n");
        if !self.caption.is_empty() {
            out.push_str(&format!("<caption>{}</caption>\n", escape_xml(&self.caption)));
        }
        let class = |column: &Column| if column.align == Align::Left { " class=\"words\"" } else { "" };
        out.push_str("<thead><tr>");
        for column in &self.columns {
            let unit = if column.unit.is_empty() {
                String::new()
            } else {
                format!("<span class=\"unit\">{}</span>", escape_xml(&column.unit))
            };
            out.push_str(&format!("<th scope=\"col\"{}>{}{unit}</th>", class(column), escape_xml(&column.heading)));
        }
        out.push_str("</tr></thead>\n<tbody>\n");
        for (r, row) in self.rows.iter().enumerate() {
            out.push_str(if self.emphasised_rows.contains(&r) { "<tr class=\"strong\">" } else { "<tr>" });
            for (c, column) in self.columns.iter().enumerate() {
                let cell = row.get(c).map_or("", String::as_str);
                out.push_str(&format!("<td{}>{}</td>", class(column), escape_xml(cell)));
            }
            out.push_str("</tr>\n");
        }
        if self.rows.is_empty() {
            let span = self.columns.len().max(1);
            out.push_str(&format!("<tr><td class=\"words none\" colspan=\"{span}\">nothing to list</td></tr>\n"));
        }
        out.push_str("</tbody>\n</table>\n");
        if !self.note.is_empty() {
            out.push_str(&format!("<p class=\"remark\">{}</p>\n", escape_xml(&self.note)));
        }
        out.push_str("</div>\n");
        out
    }
}

/// A picture as it goes into the page. Our own pictures go inline. One with style sheets, identifiers or scripts would
/// reach into the rest of the page; it is shown as an image instead, which shuts it in.
pub(super) fn picture(svg: &str, description: &str) -> String {
    let start = svg.find("<svg").unwrap_or(0);
    let reaches_out = ["<style", "<script", " id=", " onload", "<foreignObject"].iter().any(|s| svg.contains(s));
    if reaches_out || !svg.contains("<svg") {
        let code = encode(svg.as_bytes());
        format!("<img src=\"data:image/svg+xml;base64,{code}\" alt=\"{}\" />", escape_xml(description))
    } else {
        svg[start..].trim_end().to_string()
    }
}

/// The page's style sheet.
pub(super) const STYLE: &str = "
:root { --ink: #1d1f21; --muted: #62666a; --line: #d9d9d6; --accent: #c8511b; --blue: #20639b; }
* { box-sizing: border-box; }
html { -webkit-text-size-adjust: 100%; }
body { margin: 0; background: #fff; color: var(--ink);
  font: 17px/1.55 Charter, 'Bitstream Charter', 'Iowan Old Style', Palatino, 'Palatino Linotype', Georgia, 'DejaVu Serif', serif; }
main, header, footer { max-width: 1100px; margin: 0 auto; padding: 0 32px; }
header { padding-top: 56px; }
h1 { font-size: 2.1em; line-height: 1.2; font-weight: 600; letter-spacing: -0.01em; margin: 0 0 6px; }
h2 { font-size: 1.35em; line-height: 1.3; font-weight: 600; margin: 2.4em 0 0.6em; padding-top: 0.7em; border-top: 1px solid var(--line); }
h3 { font-size: 1.05em; font-weight: 600; margin: 1.8em 0 0.4em; }
p, ul { max-width: 46em; margin: 0.7em 0; }
li { margin: 0.2em 0; }
.subtitle { color: var(--muted); font-size: 1.1em; margin: 0 0 20px; }
.facts, nav, table, figcaption, .callout h3, .remark, footer {
  font-family: Inter, 'Helvetica Neue', Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif; }
.facts { display: flex; flex-wrap: wrap; gap: 4px 32px; margin: 0; padding: 12px 0; font-size: 13px; line-height: 1.5;
  border-top: 1px solid var(--ink); border-bottom: 1px solid var(--line); }
.facts div { min-width: 0; }
.facts dt { color: var(--muted); }
.facts dd { margin: 0; overflow-wrap: anywhere; font-variant-numeric: tabular-nums; }
nav { font-size: 13.5px; margin: 18px 0 0; }
nav ol { list-style: none; margin: 0; padding: 0; display: flex; flex-wrap: wrap; gap: 4px 22px; }
nav a { color: var(--blue); text-decoration: none; }
nav a:hover { text-decoration: underline; }
.table { margin: 1.3em 0; overflow-x: auto; }
table { border-collapse: collapse; font-size: 14px; line-height: 1.4; font-variant-numeric: tabular-nums lining-nums; }
caption { text-align: left; font-weight: 600; padding: 0 0 8px; }
th, td { padding: 5px 0 5px 28px; text-align: right; vertical-align: baseline; }
th:first-child, td:first-child { padding-left: 0; }
th { font-weight: 600; vertical-align: bottom; border-bottom: 1px solid var(--ink); }
tbody tr + tr td { border-top: 1px solid #eeeeec; }
tbody tr:last-child td { border-bottom: 1px solid var(--line); }
.words { text-align: left; }
.unit { display: block; font-weight: 400; color: var(--muted); }
.strong td { font-weight: 600; color: var(--accent); }
.none { color: var(--muted); }
.remark { font-size: 13px; color: var(--muted); margin: 8px 0 0; }
figure { margin: 1.6em 0; }
figure svg, figure img { display: block; max-width: 100%; height: auto; }
figcaption { font-size: 13.5px; line-height: 1.45; color: var(--muted); max-width: 56em; margin-top: 8px; }
figcaption b { color: var(--ink); font-weight: 600; }
.beside { display: flex; flex-wrap: wrap; gap: 12px 40px; align-items: flex-start; }
.beside figure { flex: 1 1 420px; min-width: 0; }
.callout { max-width: 50em; margin: 1.3em 0; padding: 2px 0 2px 18px; border-left: 3px solid var(--blue); }
.callout h3 { font-size: 14px; margin: 0.3em 0 0; color: var(--blue); }
.callout p { margin: 0.3em 0; }
.caution { border-color: var(--accent); }
.caution h3 { color: var(--accent); }
.note { border-color: var(--line); }
.note h3 { color: var(--muted); }
pre { font: 12.5px/1.5 ui-monospace, Menlo, Consolas, 'DejaVu Sans Mono', monospace; background: #f7f7f5; padding: 12px 14px;
  overflow-x: auto; }
footer { color: var(--muted); font-size: 13px; padding-top: 40px; padding-bottom: 56px; }
@media (max-width: 640px) { main, header, footer { padding-left: 16px; padding-right: 16px; } }
@media print {
  @page { size: A4; margin: 16mm; }
  body { font-size: 10.5pt; }
  main, header, footer { max-width: none; padding-left: 0; padding-right: 0; }
  header { padding-top: 0; }
  nav { display: none; }
  h2, h3, caption, .callout h3 { break-after: avoid; }
  figure, .callout, tr { break-inside: avoid; }
  .beside figure { flex-basis: 300px; }
  * { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
}
";
