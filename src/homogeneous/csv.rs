//! Reading curves as test machines write them: columns and units by their names.
//!
//! The header is the first line that names a drive and a stress; what stands before it is skipped and counted, and so
//! are empty lines and comments (`#`), but for the last comment above the numbers where no line is a header. Cells are
//! parted by semicolons, tabs, commas or blanks; with the first two, and in quotation marks, numbers may have decimal
//! commas. Upper and lower case, blanks and underscores are alike. Units end the name (`Load [N]`, `Weg/mm`, `force_n`)
//! or stand in a line below the header.
//!
//! | What | Column names, in order of preference |
//! |---|---|
//! | time (s) | `time`, `t`, `Zeit` |
//! | stretch | `stretch`, `lambda` |
//! | shear | `shear strain`, `shear`, `gamma` (simple shear; else as strain), `stretch` |
//! | strain (stretch − 1; also in %) | `engineering strain`, `nominal strain`, `strain`, `Dehnung`, other strains |
//! | displacement (needs a length) | `displacement`, `extension`, `drive`, `compression` (turned), `Weg`, crosshead |
//! | nominal stress | `nominal stress`, `engineering stress`, `shear nominal stress`, `p11` (shear: `p12`), `stress` |
//! | | `Spannung`, other stresses |
//! | force (needs an area) | `force`, `load`, `Kraft` (turned where the drive is a compression) |
//!
//! True and logarithmic quantities and rates are passed over. Of several columns that fit equally well none is taken:
//! one has to be named.

use super::csv_columns::{DriveKind, Found, StressKind, drive_column, headers, is_header, stress_column, time_column};
use super::csv_error::CsvError;
use super::csv_text::TextTable;
use super::deformation::HomogeneousTest;
use super::stress_unit::StressUnit;

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
    /// How the file was understood.
    pub reading: CsvReading,
}

/// How a file was understood.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct CsvReading {
    /// The column of the drive, as the header calls it.
    pub drive_column: String,
    /// The column of stress or force.
    pub stress_column: String,
    /// Lines before the header that were skipped.
    pub num_preamble_lines: usize,
    /// Whether decimals follow a comma.
    pub has_decimal_comma: bool,
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
    let wanted = [options.drive_column.as_deref(), options.stress_column.as_deref()];
    let table = TextTable::read(text, &|cells| is_header(&headers(cells, &[]), test, wanted))?;
    let all = headers(&table.names, &table.units);
    let columns = Columns {
        drive: drive_column(&all, test, wanted[0])?,
        stress: stress_column(&all, test, wanted[1], options.stress_unit)?,
        time: time_column(&all),
        is_shear: test == HomogeneousTest::SimpleShear,
    };
    columns.read(&table, options)
}

/// The columns that are read.
struct Columns {
    drive: Found<DriveKind>,
    stress: Found<StressKind>,
    time: Option<(usize, f64)>,
    is_shear: bool,
}

impl Columns {
    fn read(&self, table: &TextTable, options: &CsvOptions) -> Result<CsvCurve, CsvError> {
        let is_length = matches!(self.drive.kind, DriveKind::Displacement | DriveKind::Compression);
        let is_force = self.stress.kind == StressKind::Force;
        // Times of day are no numbers; curves do without.
        let time = self.time.filter(|(at, _)| table.len() > 0 && table.number(0, *at).is_ok());
        let mut curve = CsvCurve {
            time_s: Vec::new(),
            drive: Vec::new(),
            stress: Vec::new(),
            is_displacement: is_length && options.length_mm.is_none(),
            is_force: is_force && options.area_mm2.is_none(),
            num_left_out: 0,
            reading: CsvReading {
                drive_column: table.names[self.drive.at].clone(),
                stress_column: table.names[self.stress.at].clone(),
                num_preamble_lines: table.num_preamble,
                has_decimal_comma: table.has_decimal_comma,
            },
        };
        for row in 0..table.len() {
            let drive = self.drive_of(table.number(row, self.drive.at)?, options.length_mm);
            let stress = self.stress_of(table.number(row, self.stress.at)?, options.area_mm2);
            let time = time.map(|(at, factor)| table.number(row, at).map(|t| factor * t)).transpose()?;
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

    /// Stretch, amount of shear, or displacement in mm where the length is not known.
    fn drive_of(&self, number: f64, length_mm: Option<f64>) -> f64 {
        let number = number * self.drive.factor;
        let of_length = |displacement: f64| match length_mm {
            Some(length) => displacement / length + if self.is_shear { 0.0 } else { 1.0 },
            None => displacement,
        };
        match self.drive.kind {
            DriveKind::Direct => number,
            DriveKind::Strain => 1.0 + number,
            DriveKind::CompressiveStrain => 1.0 - number,
            DriveKind::Displacement => of_length(number),
            DriveKind::Compression => of_length(-number),
        }
    }

    /// Nominal stress in kPa, or force in N where the area is not known.
    fn stress_of(&self, number: f64, area_mm2: Option<f64>) -> f64 {
        let number = number * self.stress.factor;
        match self.stress.kind {
            StressKind::Stress => number,
            StressKind::CompressiveStress => -number,
            StressKind::Force => {
                let is_turned = matches!(self.drive.kind, DriveKind::Compression | DriveKind::CompressiveStrain);
                let force = if is_turned { -number } else { number };
                // N/mm² = MPa.
                area_mm2.map_or(force, |area| 1e3 * force / area)
            }
        }
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
        assert!(matches!(read("0,0\n0.1,2\n", &none), Err(CsvError::Empty { what: "header" })));
        assert!(matches!(read("a,b\n1,2\n", &none), Err(CsvError::NoColumn { .. })));
        assert!(matches!(read("stretch,p11\n1,2\n", &none), Err(CsvError::NoUnit { .. })));
        assert!(matches!(read("stretch,stress_kpa\n1,x\n", &none), Err(CsvError::NotANumber { line: 2, .. })));
        assert!(matches!(read("stretch,stress_kpa\n1\n", &none), Err(CsvError::RowLength { line: 2, .. })));
        let ambiguous = read("strain 1 [%],strain 2 [%],stress_kpa\n1,2,3\n", &none);
        assert!(matches!(ambiguous, Err(CsvError::Ambiguous { .. })), "{ambiguous:?}");
        let commas = read("strain,stress_kpa\n0,1,2,5\n", &none);
        assert!(matches!(commas, Err(CsvError::RowLength { line: 2, .. })), "{commas:?}");
        let thousands = read("strain;stress_kpa\n0,1;1.000,5\n", &none);
        assert!(matches!(thousands, Err(CsvError::NotANumber { line: 2, .. })), "{thousands:?}");
        assert!(matches!(read("strain,force\n1,2\n", &none), Err(CsvError::NoUnit { .. })));
        let bad = CsvOptions { area_mm2: Some(-1.0), ..CsvOptions::default() };
        assert!(matches!(read("stretch,stress_kpa\n1,2\n", &bad), Err(CsvError::NotPositive { .. })));
    }

    /// The same four points as four machines write them.
    #[test]
    fn files_of_test_machines_are_read() {
        let sized = CsvOptions { length_mm: Some(20.0), area_mm2: Some(10.0), ..CsvOptions::default() };
        let stretch = [1.0, 1.05, 1.1, 1.25];
        let stress = [0.0, 2.5, 4.8, 10.5];
        let files = [
            // German, with a preamble, units below the header and a separator at the end of each row.
            "Prüfer;M. Muster;\nProbenbreite;12,5;mm\n\nPrüfzeit;Dehnung;Spannung;\ns;%;MPa;\n0;0;0;\n1;5;0,0025;\n2;10;0,0048;\n\
             3;25;0,0105;\n",
            // Quoted decimal commas between commas, several channels.
            "\"Time (s)\",\"Extension (mm)\",\"Tensile strain (Strain 1) (%)\",\"Tensile stress (kPa)\"\n\
             \"0,0\",\"0,0\",\"0,0\",\"0,0\"\n\"1,0\",\"1,0\",\"5,0\",\"2,5\"\n\"2,0\",\"2,0\",\"10,0\",\"4,8\"\n\
             \"3,0\",\"5,0\",\"25,0\",\"10,5\"\n",
            // Tabs, a displacement and a force in other units.
            "Sample 7\t\nCrosshead [cm]\tForce [mN]\n0\t0\n0,1\t25\n0,2\t48\n0,5\t105\n",
            // Blanks.
            "# exported\n  strain   stress_kPa  true_stress_kPa\n 0 0 0\n .05 2.5 9\n .1 4.8 9\n .25 10.5 9\n",
        ];
        for (index, text) in files.iter().enumerate() {
            let curve = read(text, &sized).unwrap_or_else(|e| panic!("file {index}: {e}"));
            for i in 0..4 {
                // The factors of units round.
                assert!((curve.drive[i] - stretch[i]).abs() < 1e-14, "file {index}: {:?}", curve.drive);
                assert!((curve.stress[i] - stress[i]).abs() < 1e-13, "file {index}: {:?}", curve.stress);
            }
        }
        let german = read(files[0], &sized).unwrap().reading;
        assert_eq!((german.drive_column.as_str(), german.num_preamble_lines), ("Dehnung", 2));
        assert!(german.has_decimal_comma);
    }

    /// Words of both columns in one cell make no header, whatever parts the cells.
    #[test]
    fn a_header_has_two_columns() {
        let none = CsvOptions::default();
        let text = "time_s,col2_unlabelled,shear_nominal_stress_kPa,shear_strain\n0,9,1,0.1\n";
        let c = read_csv(text, HomogeneousTest::SimpleShear, &none).unwrap();
        assert_eq!((c.drive[0], c.stress[0]), (0.1, 1.0));
        let c = read("Stress-strain curve of 7;A\nstrain;stress_kpa\n0,5;2\n", &none).unwrap();
        assert_eq!((c.drive[0], c.stress[0], c.reading.num_preamble_lines), (1.5, 2.0, 1));
    }

    /// Cells that say that there is no number are left out; a header may be the comment above the numbers.
    #[test]
    fn gaps_and_headers_in_comments_are_read() {
        let none = CsvOptions::default();
        let c = read("strain,stress_kpa\n0,0\n0.1,---\n-,1\n0.2,N/A\n0.3,#NV\n0.4,8\n", &none).unwrap();
        assert_eq!((c.drive, c.stress, c.num_left_out), (vec![1.0, 1.4], vec![0.0, 8.0], 4));
        let c = read("# made by a script\n# strain stress_kpa\n0.0 0.0\n0.5 2.0\n# end\n", &none).unwrap();
        assert_eq!((c.drive, c.stress), (vec![1.0, 1.5], vec![0.0, 2.0]));
        let c = read("# strain of the grips, stress_kpa\nstretch,stress_kpa\n1.5,2.0\n", &none).unwrap();
        assert_eq!((c.drive, c.stress), (vec![1.5], vec![2.0]));
    }

    #[test]
    fn compression_is_turned() {
        let none = CsvOptions::default();
        let c = read("Compression [%],force_n\n0,0\n10,5\n", &CsvOptions { area_mm2: Some(100.0), ..none.clone() });
        let c = c.unwrap();
        assert_eq!((c.drive[1], c.stress[1]), (0.9, -50.0));
        let c = read("Compressive strain [%];Compressive stress [kPa]\n0;0\n10;5\n", &none).unwrap();
        assert_eq!((c.drive[1], c.stress[1]), (0.9, -5.0));
    }
}
