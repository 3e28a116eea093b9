//! Estimates of the width of text.

/// Widths of the printable ASCII characters in Helvetica, 1/1000 of the font size (Adobe's font metrics).
const WIDTHS: [u16; 95] = [
    278, 278, 355, 556, 556, 889, 667, 191, 333, 333, 389, 584, 278, 333, 278, 278, 556, 556, 556, 556, 556, 556, 556,
    556, 556, 556, 278, 278, 584, 584, 584, 556, 1015, 667, 667, 722, 722, 667, 611, 778, 722, 278, 500, 667, 556, 833,
    722, 778, 667, 778, 722, 667, 611, 722, 667, 944, 667, 667, 611, 278, 278, 278, 469, 556, 333, 556, 556, 500, 556,
    556, 278, 556, 556, 222, 222, 500, 222, 833, 556, 556, 556, 556, 333, 500, 278, 556, 500, 722, 500, 500, 500, 334,
    260, 334, 584,
];

/// The fonts that stand in for Helvetica are up to a sixth wider.
const WIDEST_FONT: f64 = 7.0 / 6.0;

/// Estimated width of a text, px, in the widest of the fonts that it may be shown in.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    let units: f64 = text
        .chars()
        .map(|c| match c as usize {
            code @ 32..=126 => f64::from(WIDTHS[code - 32]),
            _ => 580.0,
        })
        .sum();
    units / 1000.0 * size * WIDEST_FONT
}

/// `text` cut to a width, with an ellipsis where something is missing.
pub(super) fn shortened(text: &str, size: f64, width: f64) -> String {
    if text_width(text, size) <= width {
        return text.to_string();
    }
    let mut out = String::new();
    for c in text.chars() {
        out.push(c);
        if text_width(&out, size) + size > width {
            out.pop();
            break;
        }
    }
    format!("{}…", out.trim_end())
}

/// `text` on lines of a width, parted between words; a word that is wider is cut.
pub(super) fn wrapped(text: &str, size: f64, width: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if text_width(&format!("{line} {word}"), size) <= width => *line = format!("{line} {word}"),
            _ => lines.push(shortened(word, size, width)),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_text_is_shortened() {
        assert_eq!(shortened("short", 10.0, 100.0), "short");
        let cut = shortened("a rather long label for a bar", 10.0, 60.0);
        assert!(cut.ends_with('…') && text_width(&cut, 10.0) <= 62.0);
    }

    #[test]
    fn longer_text_takes_more_lines() {
        let text = "the encoding gradient is off by a factor along one axis";
        assert_eq!(wrapped(text, 10.0, 1000.0), [text]);
        for (width, num_lines) in [(180.0, 2), (90.0, 4)] {
            let lines = wrapped(text, 10.0, width);
            assert_eq!(lines.join(" "), text);
            assert_eq!(lines.len(), num_lines);
            assert!(lines.iter().all(|line| text_width(line, 10.0) <= width));
        }
        let cut = wrapped("unbreakable-and-long", 10.0, 40.0);
        assert!(cut.len() == 1 && cut[0].ends_with('…'));
    }
}
