//! Units as test machines write them.

use super::stress_unit::StressUnit;

/// A unit, with what one of it is in the unit that curves have (1, mm, N, kPa, s).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Unit {
    /// A plain number, or per cent.
    Ratio(f64),
    /// A length.
    Length(f64),
    /// A force.
    Force(f64),
    /// A stress.
    Stress(f64),
    /// A time.
    Time(f64),
}

/// Standard gravity, m/s², and the pound, kg, which define kgf and lbf.
const GRAVITY: f64 = 9.806_65;
const POUND: f64 = 0.453_592_37;
/// The inch, mm.
const INCH: f64 = 25.4;

impl Unit {
    /// The unit of a symbol. Upper and lower case are alike, but for the newton's milli and mega.
    pub fn of(symbol: &str) -> Option<Unit> {
        let symbol = symbol.trim();
        match symbol {
            "mN" => return Some(Unit::Force(1e-3)),
            "MN" => return Some(Unit::Force(1e6)),
            _ => {}
        }
        Some(match symbol.to_lowercase().as_str() {
            "%" | "percent" | "pct" => Unit::Ratio(0.01),
            "-" | "1" | "mm/mm" | "m/m" | "in/in" => Unit::Ratio(1.0),
            "mm" => Unit::Length(1.0),
            "cm" => Unit::Length(10.0),
            "m" => Unit::Length(1e3),
            "µm" | "μm" | "um" => Unit::Length(1e-3),
            "in" | "inch" => Unit::Length(INCH),
            "n" => Unit::Force(1.0),
            "kn" => Unit::Force(1e3),
            "gf" => Unit::Force(1e-3 * GRAVITY),
            "kgf" => Unit::Force(GRAVITY),
            "lbf" => Unit::Force(POUND * GRAVITY),
            "pa" => Unit::Stress(StressUnit::Pa.in_kpa()),
            "kpa" => Unit::Stress(StressUnit::KPa.in_kpa()),
            "mpa" | "n/mm²" | "n/mm2" | "n/mm^2" => Unit::Stress(StressUnit::MPa.in_kpa()),
            // lbf/in², in MPa and then in kPa.
            "psi" => Unit::Stress(1e3 * POUND * GRAVITY / (INCH * INCH)),
            "s" | "sec" => Unit::Time(1.0),
            "ms" => Unit::Time(1e-3),
            "min" => Unit::Time(60.0),
            "h" => Unit::Time(3600.0),
            _ => return None,
        })
    }
}

/// `(mm)`, `[mm]` or `mm` as `mm`.
pub(super) fn without_brackets(text: &str) -> &str {
    let text = text.trim();
    let inner = |open, close| text.strip_prefix(open).and_then(|t: &str| t.strip_suffix(close));
    inner('(', ')').or_else(|| inner('[', ']')).unwrap_or(text).trim()
}

/// A column's name without its unit, in lower case with single blanks, and the unit: `Load [N]`, `Extension (mm)`,
/// `Kraft in N`, `Weg/mm`, `force_n`, `Strain, %`.
pub(super) fn name_and_unit(header: &str) -> (String, Option<Unit>) {
    let header = header.trim();
    let plain = |name: &str| {
        let lower = name.to_lowercase().replace(['_', '-'], " ");
        lower.split_whitespace().collect::<Vec<_>>().join(" ").trim_end_matches([',', ':']).to_string()
    };
    if let Some(end) = header.chars().last().filter(|c| matches!(c, ')' | ']'))
        && let Some(start) = header.rfind(if end == ')' { '(' } else { '[' })
        && let Some(unit) = Unit::of(without_brackets(&header[start..]))
    {
        return (plain(&header[..start]), Some(unit));
    }
    for between in [" in ", ", ", " ", "_", "/"] {
        if let Some((name, symbol)) = header.rsplit_once(between)
            && !name.trim().is_empty()
            // Without brackets these are a number and a dash.
            && !matches!(symbol, "1" | "-")
            && let Some(unit) = Unit::of(symbol)
        {
            return (plain(name), Some(unit));
        }
    }
    (plain(header), None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_found_in_names() {
        for (header, name, unit) in [
            ("Load [N]", "load", Some(Unit::Force(1.0))),
            ("Tensile strain (Extension) (%)", "tensile strain (extension)", Some(Unit::Ratio(0.01))),
            ("Tensile strain (Extension)", "tensile strain (extension)", None),
            ("Kraft in kN", "kraft", Some(Unit::Force(1e3))),
            ("Weg/mm", "weg", Some(Unit::Length(1.0))),
            ("engineering_stress_MPa", "engineering stress", Some(Unit::Stress(1e3))),
            ("Force (mN)", "force", Some(Unit::Force(1e-3))),
            ("Force (MN)", "force", Some(Unit::Force(1e6))),
            ("Dehnung, %", "dehnung", Some(Unit::Ratio(0.01))),
            ("stretch", "stretch", None),
            ("Strain 1", "strain 1", None),
            ("Strain mm/mm", "strain", Some(Unit::Ratio(1.0))),
            ("P11", "p11", None),
            ("Tensile stress [N/mm²]", "tensile stress", Some(Unit::Stress(1e3))),
        ] {
            assert_eq!(name_and_unit(header), (name.to_string(), unit), "{header}");
        }
        // One pound per square inch is 6.894757 kPa (NIST SP 811).
        let Some(Unit::Stress(psi)) = Unit::of("psi") else { panic!() };
        assert!((psi - 6.894_757_293).abs() < 1e-8, "{psi}");
    }
}
