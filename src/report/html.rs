//! The report: one HTML file that needs nothing else, for the screen and for paper.

use super::ReportError;
use super::html_parts::{CalloutKind, STYLE, Table, picture};
use super::vtu::write_file;
use crate::field::escape_xml;
use std::path::Path;

/// What identifies the run, at the head of the page.
#[derive(Clone, Debug, Default)]
pub struct ReportHeader {
    /// Line under the title: what was asked.
    pub subtitle: String,
    /// Version of the program.
    pub program_version: String,
    /// Hash of the input.
    pub input_hash: String,
    /// Seed; None where nothing was random.
    pub seed: Option<u64>,
    /// Further facts, name and value, such as the study's file.
    pub facts: Vec<(String, String)>,
}

/// A page that grows from top to bottom. Every text is escaped; only pictures are taken as they are.
#[derive(Clone, Debug)]
pub struct Report {
    title: String,
    header: ReportHeader,
    /// Titles of the sections; the n-th has the anchor `section-n`.
    sections: Vec<String>,
    body: String,
    num_figures: usize,
}

impl Report {
    /// An empty page.
    pub fn new(title: impl Into<String>, header: ReportHeader) -> Self {
        Report { title: title.into(), header, sections: Vec::new(), body: String::new(), num_figures: 0 }
    }

    /// Starts a section; it appears in the contents.
    pub fn section(&mut self, title: &str) -> &mut Self {
        self.sections.push(title.to_string());
        self.body.push_str(&format!("<h2 id=\"section-{}\">{}</h2>\n", self.sections.len(), escape_xml(title)));
        self
    }

    /// A smaller heading.
    pub fn subsection(&mut self, title: &str) -> &mut Self {
        self.body.push_str(&format!("<h3>{}</h3>\n", escape_xml(title)));
        self
    }

    /// A paragraph. Empty lines divide it into several.
    pub fn paragraph(&mut self, text: &str) -> &mut Self {
        for part in text.split("\n\n").map(str::trim).filter(|p| !p.is_empty()) {
            self.body.push_str(&format!("<p>{}</p>\n", escape_xml(part)));
        }
        self
    }

    /// A list of points.
    pub fn list<S: AsRef<str>>(&mut self, points: &[S]) -> &mut Self {
        if !points.is_empty() {
            self.body.push_str("<ul>\n");
            for point in points {
                self.body.push_str(&format!("<li>{}</li>\n", escape_xml(point.as_ref())));
            }
            self.body.push_str("</ul>\n");
        }
        self
    }

    /// A finding in plain words, set apart.
    pub fn callout(&mut self, kind: CalloutKind, title: &str, text: &str) -> &mut Self {
        let class = match kind {
            CalloutKind::Finding => "callout",
            CalloutKind::Caution => "callout caution",
            CalloutKind::Note => "callout note",
        };
        self.body.push_str(&format!("<aside class=\"{class}\">\n<h3>{}</h3>\n", escape_xml(title)));
        self.paragraph(text);
        self.body.push_str("</aside>\n");
        self
    }

    /// A table.
    pub fn table(&mut self, table: &Table) -> &mut Self {
        self.body.push_str(&table.to_html());
        self
    }

    /// A picture with a numbered caption.
    pub fn figure(&mut self, svg: &str, caption: &str) -> &mut Self {
        let figure = self.figure_html(svg, caption);
        self.body.push_str(&figure);
        self
    }

    /// Pictures beside one another where the window is wide enough: (SVG, caption).
    pub fn figures<S: AsRef<str>, C: AsRef<str>>(&mut self, pictures: &[(S, C)]) -> &mut Self {
        self.body.push_str("<div class=\"beside\">\n");
        for (svg, caption) in pictures {
            let figure = self.figure_html(svg.as_ref(), caption.as_ref());
            self.body.push_str(&figure);
        }
        self.body.push_str("</div>\n");
        self
    }

    /// A block of text as it is, such as JSON or a command.
    pub fn verbatim(&mut self, text: &str) -> &mut Self {
        self.body.push_str(&format!("<pre>{}</pre>\n", escape_xml(text)));
        self
    }

    fn figure_html(&mut self, svg: &str, caption: &str) -> String {
        self.num_figures += 1;
        format!(
            "<figure>\n{}\n<figcaption><b>Figure {}.</b> {}</figcaption>\n</figure>\n",
            picture(svg, caption),
            self.num_figures,
            escape_xml(caption)
        )
    }

    /// The page.
    pub fn to_html(&self) -> String {
        let mut facts = vec![
            ("program".to_string(), format!("lambdak {}", self.header.program_version)),
            ("input hash".to_string(), self.header.input_hash.clone()),
        ];
        facts.extend(self.header.seed.map(|seed| ("seed".to_string(), seed.to_string())));
        facts.extend(self.header.facts.iter().cloned());
        let facts: String = facts
            .iter()
            .filter(|(_, value)| !value.is_empty())
            .map(|(name, value)| format!("<div><dt>{}</dt><dd>{}</dd></div>\n", escape_xml(name), escape_xml(value)))
            .collect();
        let subtitle = if self.header.subtitle.is_empty() {
            String::new()
        } else {
            format!("<p class=\"subtitle\">{}</p>\n", escape_xml(&self.header.subtitle))
        };
        // Three sections and more are worth a list of contents.
        let contents = if self.sections.len() < 3 {
            String::new()
        } else {
            let entries: String = self
                .sections
                .iter()
                .enumerate()
                .map(|(i, title)| format!("<li><a href=\"#section-{}\">{}</a></li>\n", i + 1, escape_xml(title)))
                .collect();
            format!("<nav aria-label=\"contents\"><ol>\n{entries}</ol></nav>\n")
        };
        let title = escape_xml(&self.title);
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\" />\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\" />\n<title>{title}</title>\n\
             <style>{STYLE}</style>\n</head>\n<body>\n<header>\n<h1>{title}</h1>\n{subtitle}\
             <dl class=\"facts\">\n{facts}</dl>\n{contents}</header>\n<main>\n{}</main>\n\
             <footer>Lengths in mm, forces in N, moduli in kPa unless a unit is given.</footer>\n</body>\n</html>\n",
            self.body
        )
    }

    /// Writes the page.
    ///
    /// # Errors
    /// [`ReportError::Write`].
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        write_file(path, self.to_html().as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::super::html_parts::Column;
    use super::super::test_xml::assert_well_formed;
    use super::*;

    fn hostile() -> Report {
        let evil = "<script>alert('x')</script> & \"quotes\"";
        let mut report = Report::new(
            evil,
            ReportHeader {
                subtitle: evil.into(),
                program_version: evil.into(),
                input_hash: evil.into(),
                seed: Some(7),
                facts: vec![(evil.into(), evil.into())],
            },
        );
        report
            .section(evil)
            .subsection(evil)
            .paragraph(evil)
            .list(&[evil])
            .callout(CalloutKind::Caution, evil, evil)
            .table(&Table {
                caption: evil.into(),
                columns: vec![Column::words(evil), Column::numbers(evil, evil)],
                rows: vec![vec![evil.into(), evil.into(), "surplus".into()], vec![]],
                emphasised_rows: vec![0, 9],
                note: evil.into(),
            })
            .table(&Table::default())
            .figure("not a picture <script>", evil)
            .verbatim(evil)
            .section("b")
            .section("c");
        report
    }

    #[test]
    fn every_text_is_escaped() {
        let html = hostile().to_html();
        assert_well_formed(&html);
        assert!(!html.contains("<script") && !html.contains("surplus"));
        assert_eq!(html, hostile().to_html());
    }

    #[test]
    fn pictures_that_reach_out_are_shut_in() {
        let mut report = Report::new("t", ReportHeader::default());
        report.figure("<?xml version=\"1.0\"?>\n<svg xmlns=\"x\"><style>text{fill:red}</style></svg>", "styled");
        report.figures(&[("<?xml version=\"1.0\"?>\n<svg xmlns=\"x\"></svg>\n", "plain")]);
        let html = report.to_html();
        assert_well_formed(&html);
        assert!(!html.contains("fill:red") && html.contains("data:image/svg+xml;base64,"));
        assert!(html.contains("<figure>\n<svg xmlns=\"x\"></svg>\n<figcaption><b>Figure 2.</b> plain"));
    }

    #[test]
    fn a_page_that_cannot_be_written_is_an_error() {
        let path = std::env::temp_dir().join("lambdak-no-such-folder").join("report.html");
        let error = Report::new("t", ReportHeader::default()).write(&path);
        assert!(matches!(error, Err(ReportError::Write { path: p, .. }) if p == path));
    }
}
