//! Numbers and parameter names as people read them.

/// `value` with `digits` significant digits: plain between 10⁻³ and 10⁶, else `1.2 × 10⁻⁴`. A real minus sign; thin
/// spaces between thousands from 10,000 on. What is not finite is a dash (–) or an infinity sign.
pub fn significant(value: f64, digits: usize) -> String {
    if value.is_nan() {
        return "–".into();
    }
    if value.is_infinite() {
        return if value > 0.0 { "∞".into() } else { "−∞".into() };
    }
    if value.abs() < f64::MIN_POSITIVE {
        return "0".into();
    }
    match Rounded::of(value, digits) {
        Rounded::Plain(text) => group_thousands(&text),
        Rounded::Power(mantissa, exponent) => format!("{} × 10{}", minus(&mantissa), superscript(exponent)),
    }
}

/// The same for terminals and files that programs read: `-0.0123`, `123000`, `1.5e-5`, `nan`, `inf`.
pub fn plain_number(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return value.to_string().to_lowercase();
    }
    if value.abs() < f64::MIN_POSITIVE {
        return "0".into();
    }
    match Rounded::of(value, digits) {
        Rounded::Plain(text) => text,
        Rounded::Power(mantissa, exponent) => format!("{mantissa}e{exponent}"),
    }
}

/// A finite number that is not zero, rounded to significant digits.
enum Rounded {
    /// Between 10⁻³ and 10⁶: its digits.
    Plain(String),
    /// Beyond: mantissa and exponent of ten.
    Power(String, i32),
}

impl Rounded {
    fn of(value: f64, digits: usize) -> Rounded {
        let digits = digits.clamp(1, 15);
        // Rust's exponent form rounds first, so 9.999 to two digits counts as 10.
        let rounded = format!("{:.*e}", digits - 1, value);
        let (mantissa, exponent) = rounded.split_once('e').unwrap_or((&rounded, "0"));
        let exponent: i32 = exponent.parse().unwrap_or(0);
        if !(-3..6).contains(&exponent) {
            return Rounded::Power(mantissa.into(), exponent);
        }
        let decimals = usize::try_from(digits as i32 - 1 - exponent).unwrap_or(0);
        // Digits before the point beyond the significant ones become zeros.
        let scale = 10f64.powi((exponent + 1 - digits as i32).max(0));
        let shown = if scale > 1.0 { (value / scale).round() * scale } else { value };
        Rounded::Plain(format!("{shown:.decimals$}"))
    }
}

/// `value` with fixed `decimals`, a real minus sign and no negative zero.
pub(super) fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    if text.bytes().all(|b| matches!(b, b'-' | b'0' | b'.')) { text.replace('-', "") } else { minus(&text) }
}

/// `text` without zeros at the end of its decimals.
pub(super) fn trimmed(text: String) -> String {
    if text.contains('.') && !text.contains('×') {
        text.trim_end_matches('0').trim_end_matches('.').to_string()
    } else {
        text
    }
}

/// A relative value as signed per cent.
pub(super) fn signed_percent(fraction: f64) -> String {
    let percent = 100.0 * fraction;
    if !percent.is_finite() {
        return significant(percent, 2);
    }
    if percent.abs() >= 1e4 {
        return format!("{} %", significant(percent, 2));
    }
    let decimals = usize::from(percent.abs() < 9.95);
    let text = fixed(percent, decimals);
    if percent > 0.0 { format!("+{text} %") } else { format!("{text} %") }
}

/// An exponent in superscript digits.
pub(super) fn superscript(exponent: i32) -> String {
    exponent.to_string().chars().map(|c| shifted(c, &['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'], '⁻')).collect()
}

fn shifted(c: char, digits: &[char; 10], sign: char) -> char {
    match c.to_digit(10) {
        Some(d) => digits[d as usize],
        None => sign,
    }
}

fn minus(text: &str) -> String {
    text.replace('-', "−")
}

fn group_thousands(text: &str) -> String {
    let (whole, fraction) = text.split_once('.').map_or((text, None), |(w, f)| (w, Some(f)));
    let (sign, whole) = whole.strip_prefix('-').map_or(("", whole), |w| ("−", w));
    let mut out = String::from(sign);
    for (i, c) in whole.chars().enumerate() {
        if whole.len() >= 5 && i > 0 && (whole.len() - i) % 3 == 0 {
            out.push('\u{2009}');
        }
        out.push(c);
    }
    if let Some(fraction) = fraction {
        out.push('.');
        out.push_str(fraction);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        for (value, digits, text) in [
            (0.0, 3, "0"),
            (1.0, 3, "1.00"),
            (-0.01234, 3, "−0.0123"),
            (9.999, 2, "10"),
            (1234.0, 2, "1200"),
            (123_456.0, 3, "123\u{2009}000"),
            (1.5e-5, 2, "1.5 × 10⁻⁵"),
            (2.5e7, 2, "2.5 × 10⁷"),
            (f64::NAN, 3, "–"),
            (f64::NEG_INFINITY, 3, "−∞"),
        ] {
            assert_eq!(significant(value, digits), text);
        }
        for (value, digits, text) in [
            (-0.01234, 3, "-0.0123"),
            (123_456.0, 3, "123000"),
            (2.6e-14, 5, "2.6000e-14"),
            (1e300, 3, "1.00e300"),
            (0.0, 4, "0"),
            (f64::NAN, 3, "nan"),
            (f64::NEG_INFINITY, 3, "-inf"),
        ] {
            assert_eq!(plain_number(value, digits), text);
        }
        assert_eq!(fixed(-0.001, 2), "0.00");
        assert_eq!(signed_percent(0.0312), "+3.1 %");
        assert_eq!(signed_percent(-0.5), "−50 %");
    }
}
