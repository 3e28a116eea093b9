//! Which columns of a table are drive, stress and time: by their names and units, in English and German.

use super::csv_error::{CsvColumn, CsvError};
use super::csv_unit::{Unit, name_and_unit};
use super::deformation::HomogeneousTest;
use super::stress_unit::StressUnit;

/// What a drive column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DriveKind {
    /// A stretch, or an amount of shear.
    Direct,
    /// A strain, stretch − 1.
    Strain,
    /// A compressive strain, 1 − stretch.
    CompressiveStrain,
    /// A displacement.
    Displacement,
    /// A displacement that shortens.
    Compression,
}

/// What a stress column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StressKind {
    /// A nominal stress.
    Stress,
    /// A nominal stress that is positive in compression.
    CompressiveStress,
    /// A force.
    Force,
}

/// A column that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Found<K> {
    /// Its index.
    pub at: usize,
    /// What it holds.
    pub kind: K,
    /// What its numbers are multiplied by.
    pub factor: f64,
}

/// A column's name in lower case and its unit.
#[derive(Clone)]
pub(super) struct Header {
    /// As it stands in the file.
    pub text: String,
    /// In lower case with single blanks, without the unit.
    pub name: String,
    /// The unit, where it is said.
    pub unit: Option<Unit>,
}

/// The columns of `names`, with the units of the line below where names have none.
pub(super) fn headers(names: &[String], units: &[String]) -> Vec<Header> {
    let of = |(index, text): (usize, &String)| {
        let (name, unit) = name_and_unit(text);
        let below = || units.get(index).and_then(|u| Unit::of(super::csv_unit::without_brackets(u)));
        Header { text: text.clone(), name, unit: unit.or_else(below) }
    };
    names.iter().enumerate().map(of).collect()
}

impl Header {
    /// Whether the words say that it is something else: a logarithmic strain, a true stress, a rate.
    fn is_other(&self) -> bool {
        ["true", "log", "hencky", "cauchy", "rate", "energy", "wahre"].iter().any(|w| self.name.contains(w))
    }

    fn has(&self, words: &[&str]) -> bool {
        words.iter().any(|w| self.name.contains(w))
    }

    fn is(&self, names: &[&str]) -> bool {
        names.contains(&self.name.as_str())
    }

    fn is_compressive(&self) -> bool {
        self.has(&["compress", "stauch", "druck"])
    }

    /// What it would be as a drive, and how well it fits: less is better.
    fn as_drive(&self, is_shear: bool) -> Option<(usize, DriveKind)> {
        if self.is_other() {
            return None;
        }
        let may_be_ratio = matches!(self.unit, None | Some(Unit::Ratio(_)));
        let may_be_length = matches!(self.unit, None | Some(Unit::Length(_)));
        let strain = if self.is_compressive() { DriveKind::CompressiveStrain } else { DriveKind::Strain };
        let strain = if is_shear { DriveKind::Direct } else { strain };
        if is_shear && may_be_ratio && self.is(&["shear strain", "shear", "gamma", "scherung"]) {
            return Some((0, DriveKind::Direct));
        }
        if may_be_ratio && self.is(&["stretch", "lambda", "λ", "stretch ratio"]) {
            return Some((if is_shear { 5 } else { 0 }, DriveKind::Direct));
        }
        if may_be_ratio && self.has(&["strain", "dehnung", "stauchung"]) {
            let best = ["engineering strain", "nominal strain", "strain", "dehnung"];
            return Some((best.iter().position(|n| self.is(&[n])).map_or(5, |p| p + 1), strain));
        }
        if matches!(self.unit, Some(Unit::Ratio(_))) && self.is(&["compression"]) {
            return Some((5, strain));
        }
        if !may_be_length {
            return None;
        }
        let lengths = [
            &["displacement"][..],
            &["extension", "elongation"],
            &["drive"],
            &["compression"],
            &["standardweg", "weg", "verlängerung", "crosshead", "traverse", "stroke", "travel", "position"],
        ];
        let kind = if self.is_compressive() { DriveKind::Compression } else { DriveKind::Displacement };
        let exact = lengths.iter().position(|names| self.is(names));
        let place = exact.or_else(|| lengths.iter().position(|words| self.has(words)).map(|p| p + lengths.len()));
        // A strain tells more than a displacement, whatever its name.
        place.map(|p| (10 + p, kind))
    }

    /// What it would be as a stress, and how well it fits: less is better.
    fn as_stress(&self, component: &str) -> Option<(usize, StressKind)> {
        if self.is_other() || self.has(&["strength", "festigkeit"]) {
            return None;
        }
        let kind = if self.is_compressive() { StressKind::CompressiveStress } else { StressKind::Stress };
        if matches!(self.unit, None | Some(Unit::Stress(_))) {
            let best =
                ["nominal stress", "engineering stress", "shear nominal stress", component, "stress", "spannung"];
            if let Some(place) = best.iter().position(|n| self.is(&[n])) {
                return Some((place, kind));
            }
            if self.has(&["stress", "spannung"]) {
                return Some((best.len(), kind));
            }
        }
        if matches!(self.unit, None | Some(Unit::Force(_))) {
            let best = [&["force"][..], &["load"], &["standardkraft", "kraft"]];
            let exact = best.iter().position(|names| self.is(names));
            let place = exact.or_else(|| best.iter().position(|words| self.has(words)).map(|p| p + best.len()));
            return place.map(|p| (10 + p, StressKind::Force));
        }
        None
    }
}

/// A column that was asked for, by index.
enum Chosen {
    /// By its name.
    Named(usize),
    /// By its number.
    Numbered(usize),
}

impl Chosen {
    /// The column that `wanted` means: by the whole header, else by its name without unit, else by its number from 1.
    ///
    /// # Errors
    /// [`CsvError::Ambiguous`], [`CsvError::UnknownColumn`].
    fn of(all: &[Header], wanted: &str, what: &'static str) -> Result<Chosen, CsvError> {
        let matching = |is: &dyn Fn(&Header) -> bool| (0..all.len()).filter(|&at| is(&all[at])).collect::<Vec<_>>();
        let lower = wanted.trim().to_lowercase();
        let mut found = matching(&|h| h.text.trim().to_lowercase() == lower);
        if found.is_empty() {
            found = matching(&|h| h.name == name_and_unit(wanted).0);
        }
        let number = || lower.parse::<usize>().ok().and_then(|n| n.checked_sub(1)).filter(|at| *at < all.len());
        match found[..] {
            [at] => Ok(Chosen::Named(at)),
            [] => number().map(Chosen::Numbered).ok_or_else(|| CsvError::UnknownColumn {
                wanted: wanted.into(),
                what,
                found: listed(all, 0..all.len()),
            }),
            _ => Err(CsvError::Ambiguous { what, found: listed(all, found) }),
        }
    }

    fn index(&self) -> usize {
        match *self {
            Chosen::Named(at) | Chosen::Numbered(at) => at,
        }
    }
}

/// Some of the columns with their numbers.
fn listed(all: &[Header], indices: impl IntoIterator<Item = usize>) -> Vec<CsvColumn> {
    indices.into_iter().map(|at| CsvColumn { number: at + 1, name: all[at].text.clone() }).collect()
}

/// That nothing was found.
pub(super) fn no_column(all: &[Header], what: &'static str) -> CsvError {
    CsvError::NoColumn { what, found: listed(all, 0..all.len()) }
}

/// The column that fits best.
fn best<K: Copy>(
    all: &[Header],
    what: &'static str,
    rank: &dyn Fn(&Header) -> Option<(usize, K)>,
) -> Result<(usize, K), CsvError> {
    let ranked: Vec<(usize, usize, K)> =
        all.iter().enumerate().filter_map(|(at, h)| rank(h).map(|(r, k)| (r, at, k))).collect();
    let Some(first) = ranked.iter().map(|(r, ..)| *r).min() else { return Err(no_column(all, what)) };
    let equal: Vec<&(usize, usize, K)> = ranked.iter().filter(|(r, ..)| *r == first).collect();
    match equal[..] {
        [&(_, at, kind)] => Ok((at, kind)),
        _ => Err(CsvError::Ambiguous { what, found: listed(all, equal.iter().map(|(_, at, _)| *at)) }),
    }
}

/// Whether one of the columns may be the drive and another one the stress, or both are those that are wanted.
pub(super) fn is_header(all: &[Header], test: HomogeneousTest, wanted: [Option<&str>; 2]) -> bool {
    let [drives, stresses] = candidates(all, test, wanted);
    drives.iter().any(|d| stresses.iter().any(|s| s != d))
}

/// Indices of the columns that may be the drive, and of those that may be the stress; of one that is wanted itself
/// alone, where it may be. A number says nothing of a line: its cell has to be such a column's name, too.
pub(super) fn candidates(all: &[Header], test: HomogeneousTest, wanted: [Option<&str>; 2]) -> [Vec<usize>; 2] {
    let is_shear = test == HomogeneousTest::SimpleShear;
    let of = |wanted: Option<&str>, ranks: &dyn Fn(&Header) -> bool| {
        let ranked = (0..all.len()).filter(|&at| ranks(&all[at]));
        match wanted.map(|name| Chosen::of(all, name, "column")) {
            None => ranked.collect(),
            Some(Ok(Chosen::Named(at))) => vec![at],
            Some(Ok(Chosen::Numbered(number))) => ranked.filter(|&at| at == number).collect(),
            Some(Err(_)) => Vec::new(),
        }
    };
    let is_stress = |h: &Header| h.as_stress(component(test)).is_some();
    [of(wanted[0], &|h| h.as_drive(is_shear).is_some()), of(wanted[1], &is_stress)]
}

/// The component of the stress that a test measures, as columns name it.
fn component(test: HomogeneousTest) -> &'static str {
    if test == HomogeneousTest::SimpleShear { "p12" } else { "p11" }
}

/// The column of the drive.
///
/// # Errors
/// [`CsvError`].
pub(super) fn drive_column(
    all: &[Header],
    test: HomogeneousTest,
    wanted: Option<&str>,
) -> Result<Found<DriveKind>, CsvError> {
    let is_shear = test == HomogeneousTest::SimpleShear;
    let (at, kind) = match wanted {
        None => best(all, "stretch, strain or displacement", &|h| h.as_drive(is_shear))?,
        Some(wanted) => {
            let at = Chosen::of(all, wanted, "drive")?.index();
            let by_unit = match all[at].unit {
                Some(Unit::Length(_)) if all[at].is_compressive() => DriveKind::Compression,
                Some(Unit::Length(_)) => DriveKind::Displacement,
                Some(Unit::Ratio(factor)) if factor < 1.0 && !is_shear => DriveKind::Strain,
                _ => DriveKind::Direct,
            };
            (at, all[at].as_drive(is_shear).map_or(by_unit, |(_, kind)| kind))
        }
    };
    let is_length = matches!(kind, DriveKind::Displacement | DriveKind::Compression);
    let column = || all[at].text.clone();
    let factor = match all[at].unit {
        Some(Unit::Length(factor)) if is_length => factor,
        Some(Unit::Ratio(factor)) if !is_length => factor,
        None if !is_length => 1.0,
        None => return Err(CsvError::NoUnit { column: column(), examples: "[mm] or _mm" }),
        Some(_) => return Err(CsvError::WrongUnit { column: column(), what: "stretch, strain or displacement" }),
    };
    Ok(Found { at, kind, factor })
}

/// The column of stress or force; `unit` is that of a stress column that does not say it.
///
/// # Errors
/// [`CsvError`].
pub(super) fn stress_column(
    all: &[Header],
    test: HomogeneousTest,
    wanted: Option<&str>,
    unit: Option<StressUnit>,
) -> Result<Found<StressKind>, CsvError> {
    let component = component(test);
    let (at, kind) = match wanted {
        None => best(all, "nominal stress or force", &|h| h.as_stress(component))?,
        Some(wanted) => {
            let at = Chosen::of(all, wanted, "stress")?.index();
            let by_unit = match all[at].unit {
                Some(Unit::Force(_)) => StressKind::Force,
                _ => StressKind::Stress,
            };
            (at, all[at].as_stress(component).map_or(by_unit, |(_, kind)| kind))
        }
    };
    let column = || all[at].text.clone();
    let factor = match (kind, all[at].unit, unit) {
        (StressKind::Force, Some(Unit::Force(factor)), _) => factor,
        (StressKind::Force, None, _) => {
            return Err(CsvError::NoUnit { column: column(), examples: "[N] or _n" });
        }
        (StressKind::Stress | StressKind::CompressiveStress, Some(Unit::Stress(factor)), _) => factor,
        (StressKind::Stress | StressKind::CompressiveStress, None, Some(unit)) => unit.in_kpa(),
        (StressKind::Stress | StressKind::CompressiveStress, None, None) => {
            return Err(CsvError::NoUnit { column: column(), examples: "[kPa] or _kpa, or give the unit of stress" });
        }
        _ => return Err(CsvError::WrongUnit { column: column(), what: "nominal stress or force" }),
    };
    Ok(Found { at, kind, factor })
}

/// Index and factor (to s) of the column of times.
pub(super) fn time_column(all: &[Header]) -> Option<(usize, f64)> {
    let names = ["time", "t", "zeit", "testzeit", "test time", "prüfzeit"];
    let at = names.iter().find_map(|name| all.iter().position(|h| h.name == *name))?;
    match all[at].unit {
        Some(Unit::Time(factor)) => Some((at, factor)),
        None => Some((at, 1.0)),
        Some(_) => None,
    }
}
