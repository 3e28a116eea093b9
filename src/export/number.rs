//! Numbers as other programs read them.

/// Digits after the first: a relative error below 10⁻¹², in fields of at most 20 characters (the longest that Abaqus
/// and CalculiX read).
const DIGITS: usize = 12;

/// A number in exponent form without needless zeros: `1.7e-2`.
pub(super) fn number(value: f64) -> String {
    let text = format!("{value:.DIGITS$e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
    // Some readers take a number without a point for a whole one.
    let point = if mantissa.contains('.') { "" } else { ".0" };
    format!("{mantissa}{point}e{exponent}")
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn numbers_fit_into_fields_and_come_back() {
        for value in [0.0, 1.0, -2.0, 0.017, -1.234_567_890_123_456_7e-300, 1.0 / 3.0, 8.205_128_205_128e200] {
            let text = number(value);
            assert!(text.len() <= 20 && text.contains('.'), "{text}");
            let back: f64 = text.parse().unwrap();
            assert!((back - value).abs() <= 1e-12 * value.abs(), "{value} {text}");
        }
        assert_eq!(number(0.017), "1.7e-2");
        assert_eq!(number(2.0), "2.0e0");
    }
}
