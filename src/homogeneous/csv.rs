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
//! one has to be named, or numbered.
//!
//! Tension is positive. What is positive in compression is turned where the name says so ([`Turned`] says it of other
//! columns).

use super::csv_columns::{
    DriveKind, Found, Header, StressKind, drive_column, headers, is_header, stress_column, time_column,
};
use super::csv_error::CsvError;
use super::csv_text::TextTable;
use super::deformation::HomogeneousTest;
use super::stress_unit::StressUnit;

/// What the reader is told beyond the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CsvOptions {
    /// Column of the drive in place of the table above, by name or by number from 1; in a biaxial test that of the
    /// first axis.
    pub drive_column: Option<String>,
    /// Column of stress or force, by name or by number from 1.
    pub stress_column: Option<String>,
    /// The same of the second axis of a biaxial test.
    pub second_drive_column: Option<String>,
    /// The same of the second axis of a biaxial test.
    pub second_stress_column: Option<String>,
    /// Unit of a stress column that does not say it.
    pub stress_unit: Option<StressUnit>,
    /// Gauge length (for shear: the gap), mm, for displacements.
    pub length_mm: Option<f64>,
    /// Area that the force acts on, mm², for forces.
    pub area_mm2: Option<f64>,
    /// Length along the second axis of a biaxial test, mm; that of the first where it is left out.
    pub second_length_mm: Option<f64>,
    /// Area of the second axis, mm²; that of the first where it is left out.
    pub second_area_mm2: Option<f64>,
    /// Columns whose sign is turned.
    pub turned: Option<Turned>,
}

/// Columns of a file with the other sign than curves have, in which tension is positive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Turned {
    /// Strain, displacement or amount of shear.
    Drive,
    /// Stress or force.
    Stress,
    /// Both.
    Both,
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
    /// The column of stress or force; in a biaxial test the first one that there is.
    pub stress_column: String,
    /// The column of the drive along the second axis, in a biaxial test.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_drive_column: Option<String>,
    /// The column of the second stress or force, in a biaxial test with two.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_stress_column: Option<String>,
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
    options.check()?;
    let wanted = [options.drive_column.as_deref(), options.stress_column.as_deref()];
    let table = TextTable::read(text, &|cells| is_header(&headers(cells, &[]), test, wanted))?;
    let all = headers(&table.names, &table.units);
    let drive = Drive {
        found: drive_column(&all, test, wanted[0])?,
        is_shear: test == HomogeneousTest::SimpleShear,
        length_mm: options.length_mm,
    }
    .with_sign(options, &table)?;
    let stress =
        Stress { found: stress_column(&all, test, wanted[1], options.stress_unit)?, area_mm2: options.area_mm2 }
            .with_sign(options);
    let rows = Rows::read(&table, &all, &[drive.found.at, stress.found.at])?;
    let [drives, stresses] = rows.columns.try_into().unwrap_or_default();
    Ok(CsvCurve {
        time_s: rows.time_s,
        drive: drives.into_iter().map(|number| drive.of(number)).collect(),
        stress: stresses.into_iter().map(|number| stress.of(number, &drive)).collect(),
        is_displacement: drive.is_length() && options.length_mm.is_none(),
        is_force: stress.is_force() && options.area_mm2.is_none(),
        num_left_out: rows.num_left_out,
        reading: CsvReading {
            drive_column: table.names[drive.found.at].clone(),
            stress_column: table.names[stress.found.at].clone(),
            second_drive_column: None,
            second_stress_column: None,
            num_preamble_lines: table.num_preamble,
            has_decimal_comma: table.has_decimal_comma,
        },
    })
}

impl CsvOptions {
    /// Checks lengths and areas.
    ///
    /// # Errors
    /// [`CsvError::NotPositive`].
    pub(super) fn check(&self) -> Result<(), CsvError> {
        let sizes = [
            ("length_mm", self.length_mm),
            ("area_mm2", self.area_mm2),
            ("second_length_mm", self.second_length_mm),
            ("second_area_mm2", self.second_area_mm2),
        ];
        for (name, value) in sizes {
            if let Some(value) = value
                && !(value > 0.0 && value.is_finite())
            {
                return Err(CsvError::NotPositive { name, value });
            }
        }
        Ok(())
    }
}

/// Complete rows of some columns.
pub(super) struct Rows {
    /// Times, s; empty without a column of times.
    pub time_s: Vec<f64>,
    /// The numbers of each column, as the file has them.
    pub columns: Vec<Vec<f64>>,
    /// Rows left out because one of the numbers is missing.
    pub num_left_out: usize,
}

impl Rows {
    /// The rows in which all columns `wanted` (indices) have a number.
    ///
    /// # Errors
    /// [`CsvError::NotANumber`]; [`CsvError::Empty`] where no row is complete.
    pub fn read(table: &TextTable, all: &[Header], wanted: &[usize]) -> Result<Rows, CsvError> {
        // Times of day are no numbers; curves do without.
        let time = time_column(all).filter(|(at, _)| table.len() > 0 && table.number(0, *at).is_ok());
        let mut rows = Rows { time_s: Vec::new(), columns: vec![Vec::new(); wanted.len()], num_left_out: 0 };
        for row in 0..table.len() {
            let numbers = wanted.iter().map(|&at| table.number(row, at)).collect::<Result<Vec<f64>, _>>()?;
            let time = time.map(|(at, factor)| table.number(row, at).map(|t| factor * t)).transpose()?;
            if !(numbers.iter().all(|n| n.is_finite()) && time.is_none_or(f64::is_finite)) {
                rows.num_left_out += 1;
                continue;
            }
            rows.columns.iter_mut().zip(numbers).for_each(|(column, number)| column.push(number));
            rows.time_s.extend(time);
        }
        if rows.columns.iter().any(Vec::is_empty) {
            return Err(CsvError::Empty { what: "rows" });
        }
        Ok(rows)
    }
}

/// A column of drives and what makes stretches of its numbers.
pub(super) struct Drive {
    pub found: Found<DriveKind>,
    pub is_shear: bool,
    pub length_mm: Option<f64>,
}

impl Drive {
    /// The drive with its sign as the options say.
    ///
    /// # Errors
    /// [`CsvError::TurnedStretch`].
    pub fn with_sign(mut self, options: &CsvOptions, table: &TextTable) -> Result<Drive, CsvError> {
        if matches!(options.turned, Some(Turned::Drive | Turned::Both)) {
            if self.found.kind == DriveKind::Direct && !self.is_shear {
                return Err(CsvError::TurnedStretch { column: table.names[self.found.at].clone() });
            }
            self.found.factor = -self.found.factor;
        }
        Ok(self)
    }

    pub fn is_length(&self) -> bool {
        matches!(self.found.kind, DriveKind::Displacement | DriveKind::Compression)
    }

    /// Stretch, amount of shear, or displacement in mm where the length is not known.
    pub fn of(&self, number: f64) -> f64 {
        let number = number * self.found.factor;
        let of_length = |displacement: f64| match self.length_mm {
            Some(length) => displacement / length + if self.is_shear { 0.0 } else { 1.0 },
            None => displacement,
        };
        match self.found.kind {
            DriveKind::Direct => number,
            DriveKind::Strain => 1.0 + number,
            DriveKind::CompressiveStrain => 1.0 - number,
            DriveKind::Displacement => of_length(number),
            DriveKind::Compression => of_length(-number),
        }
    }
}

/// A column of stresses or forces and what makes nominal stresses of its numbers.
pub(super) struct Stress {
    pub found: Found<StressKind>,
    pub area_mm2: Option<f64>,
}

impl Stress {
    /// The stress with its sign as the options say.
    pub fn with_sign(mut self, options: &CsvOptions) -> Stress {
        if matches!(options.turned, Some(Turned::Stress | Turned::Both)) {
            self.found.factor = -self.found.factor;
        }
        self
    }

    pub fn is_force(&self) -> bool {
        self.found.kind == StressKind::Force
    }

    /// Nominal stress in kPa, or force in N where the area is not known.
    pub fn of(&self, number: f64, drive: &Drive) -> f64 {
        let number = number * self.found.factor;
        match self.found.kind {
            StressKind::Stress => number,
            StressKind::CompressiveStress => -number,
            StressKind::Force => {
                let is_turned = matches!(drive.found.kind, DriveKind::Compression | DriveKind::CompressiveStrain);
                let force = if is_turned { -number } else { number };
                // N/mm² = MPa.
                self.area_mm2.map_or(force, |area| 1e3 * force / area)
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

    /// Of two columns of one name neither is taken by its name; their numbers tell them apart, whatever the names are.
    #[test]
    fn columns_are_chosen_by_number() {
        let of = |drive: &str, stress: &str| CsvOptions {
            drive_column: Some(drive.into()),
            stress_column: Some(stress.into()),
            stress_unit: Some(StressUnit::KPa),
            ..CsvOptions::default()
        };
        let twice = "Probe;A;1\nstrain;stress;stress\n0,1;1;2\n0,2;3;4\n";
        assert!(matches!(read(twice, &of("strain", "stress")), Err(CsvError::Ambiguous { .. })));
        for (column, expected) in [("2", [1.0, 3.0]), ("3", [2.0, 4.0])] {
            assert_eq!(read(twice, &of("strain", column)).unwrap().stress, expected);
            assert_eq!(read(twice, &of("1", column)).unwrap().stress, expected);
        }
        let Err(error) = read(twice, &of("strain", "4")) else { panic!() };
        let expected = "\"4\" is neither name nor number of a column for the stress; there are 1 \"strain\", 2 \
                        \"stress\", 3 \"stress\"";
        assert_eq!(error.to_string(), expected);
        assert!(matches!(read(twice, &of("strain", "0")), Err(CsvError::UnknownColumn { .. })));
        let unknown = "Probe;A\nKanal 1;Kanal 2\nkPa;%\n7;10\n9;20\n";
        let c = read(unknown, &of("2", "1")).unwrap();
        assert_eq!((c.drive, c.stress, c.reading.num_preamble_lines), (vec![1.1, 1.2], vec![7.0, 9.0], 1));
        // A name comes before a number.
        let named = read("2,1\n0.5,7\n", &of("2", "1")).unwrap();
        assert_eq!((named.drive, named.stress), (vec![0.5], vec![7.0]));
    }

    /// Signs are turned where the file does not say that compression is positive; a stretch has none.
    #[test]
    fn signs_are_turned() {
        let turned = |turned| CsvOptions { turned: Some(turned), area_mm2: Some(100.0), ..CsvOptions::default() };
        let text = "strain,force_n\n0.1,5\n";
        let both = read(text, &turned(Turned::Both)).unwrap();
        assert_eq!((both.drive[0], both.stress[0]), (0.9, -50.0));
        let stress = read("stretch,force_n\n0.9,5\n", &turned(Turned::Stress)).unwrap();
        assert_eq!((stress.drive[0], stress.stress[0]), (0.9, -50.0));
        let shear =
            read_csv("shear,stress_kpa\n0.1,5\n", HomogeneousTest::SimpleShear, &turned(Turned::Drive)).unwrap();
        assert_eq!((shear.drive[0], shear.stress[0]), (-0.1, 5.0));
        let stretch = read("stretch,force_n\n0.9,5\n", &turned(Turned::Both));
        assert!(matches!(stretch, Err(CsvError::TurnedStretch { .. })), "{stretch:?}");
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
