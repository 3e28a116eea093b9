//! Reading biaxial tests: two stretches in the plane, each with its stress or one of both alone.
//!
//! Columns are those of [`read_csv`](super::read_csv) with a mark of their axis: `stretch_1` and `stretch_2`,
//! `strain x [%]`, `lambda_y`, `F11`, `P22`, `Force X [N]`. A column of stresses without any number is none.

use super::csv::{CsvOptions, CsvReading, Drive, Rows, Stress};
use super::csv_axes::axis_headers;
use super::csv_columns::{Header, candidates, drive_column, headers, no_column, stress_column};
use super::csv_error::CsvError;
use super::csv_text::TextTable;
use super::deformation::HomogeneousTest;

/// Columns of an axis are found as those of an equibiaxial test are.
const LIKE: HomogeneousTest = HomogeneousTest::Equibiaxial;

/// A biaxial test as read.
#[derive(Clone, Debug, PartialEq)]
pub struct BiaxialCsv {
    /// Times, s; empty without a time column.
    pub time_s: Vec<f64>,
    /// Stretches along both axes. With a displacement column and no length: the displacement, mm.
    pub drives: Vec<[f64; 2]>,
    /// Nominal stress along each axis, kPa, where it was measured; at least one was. With a force column and no area:
    /// the force, N.
    pub stresses: [Option<Vec<f64>>; 2],
    /// Whether a drive is a displacement in mm.
    pub is_displacement: bool,
    /// Whether a stress is a force in N.
    pub is_force: bool,
    /// Rows left out because a number was missing (empty or NaN).
    pub num_left_out: usize,
    /// How the file was understood.
    pub reading: CsvReading,
}

/// What is wanted of one axis.
#[derive(Clone, Copy)]
struct Wanted<'a> {
    drive: Option<&'a str>,
    stress: Option<&'a str>,
    length_mm: Option<f64>,
    area_mm2: Option<f64>,
}

impl Wanted<'_> {
    fn of(options: &CsvOptions) -> [Wanted<'_>; 2] {
        let (drive, second_drive) = (options.drive_column.as_deref(), options.second_drive_column.as_deref());
        let (stress, second_stress) = (options.stress_column.as_deref(), options.second_stress_column.as_deref());
        [
            Wanted { drive, stress, length_mm: options.length_mm, area_mm2: options.area_mm2 },
            Wanted {
                drive: second_drive,
                stress: second_stress,
                length_mm: options.second_length_mm.or(options.length_mm),
                area_mm2: options.second_area_mm2.or(options.area_mm2),
            },
        ]
    }
}

/// A name that is asked for is looked for as it stands; else the columns are those of the axis.
fn shown<'a>(all: &'a [Header], of_axis: &'a [Header], wanted: Option<&str>) -> &'a [Header] {
    if wanted.is_some() { all } else { of_axis }
}

/// Whether both stretches may be columns, and a stress.
fn is_header(all: &[Header], wanted: &[Wanted; 2]) -> bool {
    let mut has_stress = false;
    let have_drives = [0, 1].map(|axis| {
        let (of_axis, Wanted { drive, stress, .. }) = (axis_headers(all, axis), wanted[axis]);
        let [drives, _] = candidates(shown(all, &of_axis, drive), LIKE, [drive, None]);
        let [_, stresses] = candidates(shown(all, &of_axis, stress), LIKE, [None, stress]);
        has_stress |= !stresses.is_empty();
        !drives.is_empty()
    });
    have_drives == [true, true] && has_stress
}

/// Reads a biaxial test.
///
/// # Errors
/// [`CsvError`].
///
/// ```
/// use lambdak::homogeneous::{CsvOptions, read_biaxial_csv};
/// let text = "lambda_x,lambda_y,P11 [kPa],P22 [kPa]\n1,1,0,0\n1.2,1.1,5,4\n";
/// let test = read_biaxial_csv(text, &CsvOptions::default()).unwrap();
/// assert_eq!(test.drives[1], [1.2, 1.1]);
/// assert_eq!(test.stresses[1].as_deref(), Some(&[0.0, 4.0][..]));
/// ```
pub fn read_biaxial_csv(text: &str, options: &CsvOptions) -> Result<BiaxialCsv, CsvError> {
    options.check()?;
    let wanted = Wanted::of(options);
    let table = TextTable::read(text, &|cells| is_header(&headers(cells, &[]), &wanted))?;
    let all = headers(&table.names, &table.units);
    let has_numbers =
        |stress: &Stress| (0..table.len()).any(|row| table.number(row, stress.found.at).is_ok_and(f64::is_finite));
    let of_axis = |axis: usize| {
        let (of_axis, wanted) = (axis_headers(&all, axis), wanted[axis]);
        let found = drive_column(shown(&all, &of_axis, wanted.drive), LIKE, wanted.drive)?;
        let drive = Drive { found, is_shear: false, length_mm: wanted.length_mm }.with_sign(options, &table)?;
        let found = stress_column(shown(&all, &of_axis, wanted.stress), LIKE, wanted.stress, options.stress_unit);
        let stress = match found {
            Ok(found) => Some(Stress { found, area_mm2: wanted.area_mm2 }.with_sign(options)).filter(has_numbers),
            Err(CsvError::NoColumn { .. }) => None,
            Err(other) => return Err(other),
        };
        Ok((drive, stress))
    };
    let axes = [of_axis(0)?, of_axis(1)?];
    let measured = || axes.iter().filter_map(|(drive, stress)| Some((drive, stress.as_ref()?)));
    if measured().next().is_none() && table.len() > 0 {
        return Err(no_column(&all, "nominal stress or force along one of both axes"));
    }
    let wanted: Vec<usize> =
        axes.iter().map(|(drive, _)| drive.found.at).chain(measured().map(|(_, s)| s.found.at)).collect();
    let rows = Rows::read(&table, &all, &wanted)?;
    let mut columns = rows.columns.into_iter();
    let mut next = || columns.next().unwrap_or_default();
    let [first, second] = [next(), next()];
    let pairs = first.into_iter().zip(second);
    let drives = pairs.map(|(a, b)| [axes[0].0.of(a), axes[1].0.of(b)]).collect();
    let stresses = [&axes[0], &axes[1]].map(|(drive, stress)| {
        stress.as_ref().map(|stress| next().into_iter().map(|number| stress.of(number, drive)).collect())
    });
    let mut names = measured().map(|(_, stress)| table.names[stress.found.at].clone());
    Ok(BiaxialCsv {
        time_s: rows.time_s,
        drives,
        stresses,
        is_displacement: axes.iter().any(|(drive, _)| drive.is_length() && drive.length_mm.is_none()),
        is_force: measured().any(|(_, stress)| stress.is_force() && stress.area_mm2.is_none()),
        num_left_out: rows.num_left_out,
        reading: CsvReading {
            drive_column: table.names[axes[0].0.found.at].clone(),
            stress_column: names.next().unwrap_or_default(),
            second_drive_column: Some(table.names[axes[1].0.found.at].clone()),
            second_stress_column: names.next(),
            num_preamble_lines: table.num_preamble,
            has_decimal_comma: table.has_decimal_comma,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<BiaxialCsv, CsvError> {
        read_biaxial_csv(text, &CsvOptions::default())
    }

    /// The same two points as laboratories write them.
    #[test]
    fn files_of_biaxial_rigs_are_read() {
        let sized = CsvOptions {
            length_mm: Some(10.0),
            second_length_mm: Some(20.0),
            area_mm2: Some(5.0),
            ..CsvOptions::default()
        };
        let files = [
            "stretch_1,stretch_2,stress_1_kpa,stress_2_kpa\n1,1,0,0\n1.2,1.1,6,4\n",
            "Prüfer;A\nDehnung x [%];Dehnung y [%];Spannung x;Spannung y\n%;%;MPa;MPa\n0;0;0;0\n20;10;0,006;0,004\n",
            "time_s,F11,F22,P11 [kPa],P22 [kPa]\n0,1,1,0,0\n1,1.2,1.1,6,4\n",
            "lambda_x lambda_y P_x_kPa P_y_kPa\n1 1 0 0\n1.2 1.1 6 4\n",
            "Time_S,XSize_um,XDisplacement_um,YDisplacement_um,XForce_mN,YForce_mN\n0,9,0,0,0,0\n1,9,2000,2000,30,20\n",
        ];
        for text in files {
            let found = read_biaxial_csv(text, &sized).unwrap_or_else(|e| panic!("{text}: {e}"));
            let stresses = found.stresses.map(Option::unwrap);
            assert!(!found.is_displacement && !found.is_force);
            for axis in 0..2 {
                // The factors of units round.
                assert!((found.drives[1][axis] - [1.2, 1.1][axis]).abs() < 1e-14, "{text}: {:?}", found.drives);
                assert!((stresses[axis][1] - [6.0, 4.0][axis]).abs() < 1e-13, "{text}: {stresses:?}");
            }
        }
    }

    /// One stress may be missing, as a column or as its numbers; rows with a gap are left out.
    #[test]
    fn gaps_and_missing_stresses() {
        let one = read("stretch_1,stretch_2,stress_2_kpa\n1,1,0\n1.2,1.1,4\n").unwrap();
        assert_eq!(one.stresses, [None, Some(vec![0.0, 4.0])]);
        assert_eq!((one.reading.stress_column.as_str(), one.reading.second_stress_column), ("stress_2_kpa", None));
        let empty = read("stretch_1,stretch_2,P11_kpa,P22_kpa\n1,1,0,\n1.2,1.1,4,\n").unwrap();
        assert_eq!((empty.stresses, empty.num_left_out), ([Some(vec![0.0, 4.0]), None], 0));
        let gap = read("stretch_1,stretch_2,P11_kpa,P22_kpa\n1,1,0,0\n1.2,1.1,4,\n1.3,,5,3\n1.4,1.2,6,4\n").unwrap();
        assert_eq!((gap.drives, gap.num_left_out), (vec![[1.0, 1.0], [1.4, 1.2]], 2));
    }

    #[test]
    fn bad_files_are_refused() {
        for text in ["stretch,stress_kpa\n1,2\n", "stretch_1,stress_1_kpa\n1,2\n", "stretch_1,stretch_2,force\n1,1,2\n"]
        {
            assert!(matches!(read(text), Err(CsvError::NoColumn { .. })), "{text}: {:?}", read(text));
        }
        let twice = read("stretch_1,stretch_1,stretch_2,P11_kpa\n1,1,1,2\n");
        assert!(matches!(twice, Err(CsvError::Ambiguous { .. })), "{twice:?}");
        let no_unit = read("stretch_1,stretch_2,P11\n1,1,2\n");
        assert!(matches!(no_unit, Err(CsvError::NoUnit { .. })), "{no_unit:?}");
        assert!(matches!(read("stretch_1,stretch_2,P11_kpa\n"), Err(CsvError::Empty { what: "rows" })));
    }

    /// Columns of any name are taken where they are named or numbered.
    #[test]
    fn columns_are_chosen() {
        let text = "a,b,stress_kpa,stress_kpa\n1,1,0,0\n1.2,1.1,6,4\n";
        let of = |drive: &str, second: &str, stress: &str, second_stress: &str| CsvOptions {
            drive_column: Some(drive.into()),
            second_drive_column: Some(second.into()),
            stress_column: Some(stress.into()),
            second_stress_column: Some(second_stress.into()),
            ..CsvOptions::default()
        };
        let found = read_biaxial_csv(text, &of("b", "a", "4", "3")).unwrap();
        assert_eq!((found.drives[1], found.stresses[0].as_ref().unwrap()[1]), ([1.1, 1.2], 4.0));
        let twice = read_biaxial_csv(text, &of("a", "b", "stress_kpa", "4"));
        assert!(matches!(twice, Err(CsvError::Ambiguous { .. })), "{twice:?}");
    }
}
