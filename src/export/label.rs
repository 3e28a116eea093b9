//! Names that other programs accept.

/// Longest name that all of them read.
const LONGEST: usize = 60;

/// `name` with letters, digits, minus signs and underscores alone, beginning with a letter.
pub(super) fn label(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    let text: String = name.chars().map(plain).take(LONGEST).collect();
    if text.starts_with(|c: char| c.is_ascii_alphabetic()) { text } else { format!("M_{text}") }
}

#[cfg(test)]
mod tests {
    use super::label;

    #[test]
    fn labels_are_plain() {
        assert_eq!(label("ecoflex-0020"), "ecoflex-0020");
        assert_eq!(label("00 20, ä\n*END"), "M_00_20_____END");
        assert_eq!(label(""), "M_");
        assert!(label(&"x".repeat(500)).len() <= 60);
    }
}
