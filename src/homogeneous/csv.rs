//! Reading curves from CSV text: columns by name, units from the names.
//!
//! The first line that is neither empty nor a comment (`#`) is the header. Names are compared in lower case.
//!
//! | What | Column names, in order of preference |
//! |---|---|
//! | time, s | `time_s`, `time`, `t` |
//! | stretch | `stretch`, `lambda` |
//! | shear | `shear_strain`, `shear`, `gamma` (simple shear; else as strain), `stretch` |
//! | strain (stretch − 1) | `engineering_strain`, `nominal_strain`, `strain` |
//! | displacement, mm (needs a length) | `displacement_mm`, `extension_mm`, `drive_mm`, `compression_mm` (turned) |
//! | nominal stress | `nominal_stress`, `engineering_stress`, `shear_nominal_stress`, `p11` (shear: `p12`), `stress` |
//! | | each with or without `_pa`, `_kpa`, `_mpa` |
//! | force, N (needs an area) | `force_n`, `load_n` (turned where the drive is a compression) |

use super::deformation::HomogeneousTest;

/// Most rows that are read: a day at ten readings a second.
const MAX_ROWS: usize = 1_000_000;

/// A unit of stress.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum StressUnit {
    /// Pa.
    Pa,
    /// kPa.
    KPa,
    /// MPa.
    MPa,
}

impl StressUnit {
    /// One of it in kPa.
    pub fn in_kpa(self) -> f64 {
        match self {
            StressUnit::Pa => 1e-3,
            StressUnit::KPa => 1.0,
            StressUnit::MPa => 1e3,
        }
    }

    /// Its symbol.
    pub fn symbol(self) -> &'static str {
        match self {
            StressUnit::Pa => "Pa",
            StressUnit::KPa => "kPa",
            StressUnit::MPa => "MPa",
        }
    }
}

/// What the reader is told beyond the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CsvOptions {
    /// Column of the drive, in place of the table above.
    pub drive_column: Option<String>,
    /// Column of stress or force.
    pub stress_column: Option<String>,
    /// Unit of a stress column that does not say it.
    pub stress_unit: Option<StressUnit>,
    /// Gauge length (for shear: the gap), mm, for displacements.
    pub length_mm: Option<f64>,
    /// Area that the force acts on, mm², for forces.
    pub area_mm2: Option<f64>,
}

/// A curve as read.
#[derive(Clone, Debug, PartialEq)]
pub struct CsvCurve {
    /// Times, s; empty without a time column.
    pub time_s: Vec<f64>,
    /// Stretch, or amount of shear. With a displacement column and no length: the displacement, mm.
    pub drive: Vec<f64>,
    /// Nominal stress, kPa. With a force column and no area: the force, N.
    pub stress: Vec<f64>,
    /// Whether `drive` is a displacement in mm.
    pub is_displacement: bool,
    /// Whether `stress` is a force in N.
    pub is_force: bool,
    /// Rows left out because a number was missing (empty or NaN).
    pub num_left_out: usize,
}

/// Why a CSV is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CsvError {
    /// No header or no rows.
    #[error("the file has no {what}; the first line names the columns, numbers follow")]
    Empty {
        /// What is missing.
        what: &'static str,
    },
    /// A needed column is not there.
    #[error("no column for the {what} among {found:?}; name it with an option")]
    NoColumn {
        /// What is looked for.
        what: &'static str,
        /// The header.
        found: Vec<String>,
    },
    /// A cell is not a number.
    #[error("line {line}: {text:?} is not a number")]
    NotANumber {
        /// Line, from 1.
        line: usize,
        /// The cell.
        text: String,
    },
    /// A row of another length than the header.
    #[error("line {line} has {found} cells, the header {expected}")]
    RowLength {
        /// Line, from 1.
        line: usize,
        /// Cells found.
        found: usize,
        /// Cells of the header.
        expected: usize,
    },
    /// The unit of a stress cannot be told.
    #[error("column {column:?} does not say its unit; end its name in _pa, _kpa or _mpa, or give the unit")]
    NoUnit {
        /// The column.
        column: String,
    },
    /// Too many rows.
    #[error("more than {limit} rows; thin the recording")]
    TooLong {
        /// The limit.
        limit: usize,
    },
    /// A length or area that cannot be.
    #[error("{name} is {value}; it must be positive")]
    NotPositive {
        /// Which.
        name: &'static str,
        /// Its value.
        value: f64,
    },
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Direct,
    Strain,
    Displacement,
    Compression,
}

/// Reads a curve of `test`.
///
/// # Errors
/// [`CsvError`].
///
/// ```
/// use lambdak::homogeneous::{CsvOptions, HomogeneousTest, read_csv};
/// let text = "strain,nominal_stress_mpa\n0,0\n0.1,0.02\n";
/// let curve = read_csv(text, HomogeneousTest::Uniaxial, &CsvOptions::default()).unwrap();
/// assert_eq!(curve.drive, [1.0, 1.1]);
/// assert_eq!(curve.stress, [0.0, 20.0]);
/// ```
pub fn read_csv(text: &str, test: HomogeneousTest, options: &CsvOptions) -> Result<CsvCurve, CsvError> {
    for (name, value) in [("length_mm", options.length_mm), ("area_mm2", options.area_mm2)] {
        if let Some(value) = value
            && !(value > 0.0 && value.is_finite())
        {
            return Err(CsvError::NotPositive { name, value });
        }
    }
    let mut lines = text
        .trim_start_matches('\u{feff}')
        .lines()
        .enumerate()
        .filter(|(_, l)| !l.trim().is_empty() && !l.trim_start().starts_with('#'));
    let (_, header) = lines.next().ok_or(CsvError::Empty { what: "header" })?;
    let separator = if header.contains(';') { ';' } else { ',' };
    let names: Vec<String> = header.split(separator).map(|n| n.trim().trim_matches('"').to_ascii_lowercase()).collect();
    let find = |wanted: &[&str]| wanted.iter().find_map(|w| names.iter().position(|n| n == w));
    let (drive_at, kind) = drive_column(&names, test, options)?;
    let (stress_at, factor, is_force) = stress_column(&names, test, options)?;
    let time_at = find(&["time_s", "time", "t"]);
    let is_shear = test == HomogeneousTest::SimpleShear;
    let mut curve = CsvCurve {
        time_s: Vec::new(),
        drive: Vec::new(),
        stress: Vec::new(),
        is_displacement: matches!(kind, Kind::Displacement | Kind::Compression) && options.length_mm.is_none(),
        is_force: is_force && options.area_mm2.is_none(),
        num_left_out: 0,
    };
    for (index, line) in lines {
        if curve.drive.len() == MAX_ROWS {
            return Err(CsvError::TooLong { limit: MAX_ROWS });
        }
        let cells: Vec<&str> = line.split(separator).map(str::trim).collect();
        if cells.len() != names.len() {
            return Err(CsvError::RowLength { line: index + 1, found: cells.len(), expected: names.len() });
        }
        let number = |at: usize| -> Result<f64, CsvError> {
            if cells[at].is_empty() {
                return Ok(f64::NAN);
            }
            cells[at].parse().map_err(|_| CsvError::NotANumber { line: index + 1, text: cells[at].into() })
        };
        let (mut drive, mut stress) = (number(drive_at)?, number(stress_at)? * factor);
        let time = time_at.map(number).transpose()?;
        if kind == Kind::Compression {
            drive = -drive;
            if is_force {
                stress = -stress;
            }
        }
        if let (true, Some(length)) = (matches!(kind, Kind::Displacement | Kind::Compression), options.length_mm) {
            drive = drive / length + if is_shear { 0.0 } else { 1.0 };
        }
        if kind == Kind::Strain {
            drive += 1.0;
        }
        if let (true, Some(area)) = (is_force, options.area_mm2) {
            // N/mm² = MPa.
            stress *= 1e3 / area;
        }
        if !(drive.is_finite() && stress.is_finite() && time.is_none_or(f64::is_finite)) {
            curve.num_left_out += 1;
            continue;
        }
        curve.drive.push(drive);
        curve.stress.push(stress);
        curve.time_s.extend(time);
    }
    if curve.drive.is_empty() {
        return Err(CsvError::Empty { what: "rows" });
    }
    Ok(curve)
}

fn drive_column(names: &[String], test: HomogeneousTest, options: &CsvOptions) -> Result<(usize, Kind), CsvError> {
    let is_shear = test == HomogeneousTest::SimpleShear;
    let kind_of = |name: &str| match name {
        n if n.contains("compression") => Kind::Compression,
        n if n.ends_with("_mm") => Kind::Displacement,
        n if n.contains("strain") && !is_shear => Kind::Strain,
        _ => Kind::Direct,
    };
    if let Some(wanted) = &options.drive_column {
        let name = wanted.to_ascii_lowercase();
        let at = names.iter().position(|n| *n == name);
        let missing = CsvError::NoColumn { what: "drive", found: names.to_vec() };
        return at.map(|at| (at, kind_of(&name))).ok_or(missing);
    }
    let wanted: &[&str] = if is_shear {
        &["shear_strain", "shear", "gamma", "strain", "stretch", "displacement_mm", "drive_mm"]
    } else {
        &[
            "stretch",
            "lambda",
            "engineering_strain",
            "nominal_strain",
            "strain",
            "displacement_mm",
            "extension_mm",
            "drive_mm",
            "compression_mm",
        ]
    };
    let at = wanted.iter().find_map(|w| names.iter().position(|n| n == w));
    at.map(|at| (at, kind_of(&names[at])))
        .ok_or_else(|| CsvError::NoColumn { what: "stretch, strain or displacement", found: names.to_vec() })
}

/// Index, factor to kPa (or N), whether it is a force.
fn stress_column(
    names: &[String],
    test: HomogeneousTest,
    options: &CsvOptions,
) -> Result<(usize, f64, bool), CsvError> {
    let unit = |name: &str| {
        let said = [("_mpa", StressUnit::MPa), ("_kpa", StressUnit::KPa), ("_pa", StressUnit::Pa)]
            .into_iter()
            .find(|(end, _)| name.ends_with(end))
            .map(|(_, u)| u);
        said.or(options.stress_unit).map(StressUnit::in_kpa).ok_or_else(|| CsvError::NoUnit { column: name.into() })
    };
    let answer = |at: usize| {
        let name = names[at].as_str();
        if name.ends_with("_n") { Ok((at, 1.0, true)) } else { unit(name).map(|f| (at, f, false)) }
    };
    if let Some(wanted) = &options.stress_column {
        let name = wanted.to_ascii_lowercase();
        let at = names.iter().position(|n| *n == name);
        return at.map(answer).unwrap_or(Err(CsvError::NoColumn { what: "stress", found: names.to_vec() }));
    }
    let component = if test == HomogeneousTest::SimpleShear { "p12" } else { "p11" };
    let stems = ["nominal_stress", "engineering_stress", "shear_nominal_stress", component, "stress"];
    let by_stem = stems.iter().find_map(|stem| {
        names.iter().position(|n| n.strip_prefix(stem).is_some_and(|rest| matches!(rest, "" | "_pa" | "_kpa" | "_mpa")))
    });
    let by_force = || ["force_n", "load_n"].iter().find_map(|w| names.iter().position(|n| n == w));
    match by_stem.or_else(by_force) {
        Some(at) => answer(at),
        None => Err(CsvError::NoColumn { what: "nominal stress or force", found: names.to_vec() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, options: &CsvOptions) -> Result<CsvCurve, CsvError> {
        read_csv(text, HomogeneousTest::Uniaxial, options)
    }

    #[test]
    fn units_and_kinds_come_from_the_names() {
        let none = CsvOptions::default();
        let sized = CsvOptions { length_mm: Some(30.0), area_mm2: Some(100.0), ..CsvOptions::default() };
        let c = read("# note\nTime_s;Engineering_Strain;Engineering_Stress_MPa\n0;0;0\n1;0.5;0.2\n2;;0.3\n", &none)
            .unwrap();
        assert_eq!((c.drive, c.stress, c.num_left_out), (vec![1.0, 1.5], vec![0.0, 200.0], 1));
        let c = read("time_s,compression_mm,load_N\n0,0,0\n1,3,5\n", &sized).unwrap();
        assert_eq!((c.drive[1], c.stress[1]), (0.9, -50.0));
        let c = read("displacement_mm,force_n\n0,0\n1,3\n", &none).unwrap();
        assert!(c.is_displacement && c.is_force && c.stress[1] > 2.9);
        let shear = read_csv("shear_strain,nominal_stress_kPa\n0.1,3\n", HomogeneousTest::SimpleShear, &none).unwrap();
        assert_eq!(shear.drive, [0.1]);
    }

    #[test]
    fn bad_files_are_refused() {
        let none = CsvOptions::default();
        assert!(matches!(read("", &none), Err(CsvError::Empty { what: "header" })));
        assert!(matches!(read("stretch,stress_kpa\n", &none), Err(CsvError::Empty { what: "rows" })));
        assert!(matches!(read("a,b\n1,2\n", &none), Err(CsvError::NoColumn { .. })));
        assert!(matches!(read("stretch,p11\n1,2\n", &none), Err(CsvError::NoUnit { .. })));
        assert!(matches!(read("stretch,stress_kpa\n1,x\n", &none), Err(CsvError::NotANumber { line: 2, .. })));
        assert!(matches!(read("stretch,stress_kpa\n1\n", &none), Err(CsvError::RowLength { line: 2, .. })));
        let bad = CsvOptions { area_mm2: Some(-1.0), ..CsvOptions::default() };
        assert!(matches!(read("stretch,stress_kpa\n1,2\n", &bad), Err(CsvError::NotPositive { .. })));
    }
}
