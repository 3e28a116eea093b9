//! Text from outside, made fit to be shown in a line: no characters that do not show or that reorder others, no numbers
//! of hundreds of digits.

/// More characters than any number that says something.
const LONGEST_NUMBER: usize = 24;

/// Characters that reorder the text around them, or show nothing: with them a name can look like another one.
fn is_deceptive(c: char) -> bool {
    matches!(c,
        '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{2069}' | '\u{feff}'
        | '\u{fff9}'..='\u{fffb}')
}

/// The first `max` characters that show and stay in their place.
pub fn printable(text: &str, max: usize) -> String {
    text.chars().filter(|c| !c.is_control() && !is_deceptive(*c)).take(max).collect()
}

/// The text with every number that has more digits than say something in powers of ten: 1e308 for a one with 308 zeros.
pub fn with_short_numbers(text: &str) -> String {
    let mut out = String::with_capacity(text.len().min(1 << 12));
    let mut rest = text;
    while let Some(start) = rest.find(|c: char| c.is_ascii_digit()) {
        let length = rest[start..].find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len() - start);
        let (before, number, after) = (&rest[..start], &rest[start..start + length], &rest[start + length..]);
        // Identifiers hold digits, too.
        let is_word = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || c == '_');
        let is_within_word = is_word(before.chars().next_back()) || is_word(after.chars().next());
        out.push_str(before);
        match number.parse::<f64>() {
            Ok(value) if number.len() > LONGEST_NUMBER && !is_within_word => out.push_str(&format!("{value:e}")),
            _ => out.push_str(number),
        }
        rest = after;
    }
    out + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_look_like_others() {
        assert_eq!(printable("abc\u{202e}gpj.exe\u{200b}\u{7}\n", 200), "abcgpj.exe");
        assert_eq!(printable("Größe μ 試料", 7), "Größe μ");
    }

    #[test]
    fn long_numbers_are_short() {
        let text = format!("is {}; from {} to -{}, {}", 1e308, 0.1, 1e300, 1e-300);
        assert_eq!(with_short_numbers(&text), "is 1e308; from 0.1 to -1e300, 1e-300");
        let hash = "a1b2".repeat(16) + &"1".repeat(40);
        assert_eq!(with_short_numbers(&hash), hash);
        assert_eq!(with_short_numbers("3.14159265358979 mm"), "3.14159265358979 mm");
    }
}
