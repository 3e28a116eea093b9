//! Curves as requests hold them: the text of a CSV file, and how its columns are understood.

use super::{JobError, Outcome};
use crate::field::FieldError;
use crate::homogeneous::{
    BULK_OVER_SHEAR, CsvCurve, CsvOptions, CsvReading, Curve, CurveError, CurveFitOptions, HomogeneousTest, StressUnit,
    Turned, Unloading, read_biaxial_csv, read_csv,
};
use crate::material::{LawKind, Material, MaterialError};
use crate::report::plain_number;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// How the columns of a curve's file are understood.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CurveColumns {
    /// Column of stretch, strain, shear or displacement, by its name or by its number from 1; found by the names that
    /// are known where it is left out. In a biaxial test that of the first axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 200)]
    pub drive_column: Option<String>,
    /// Column of nominal stress or force, by its name or by its number from 1; found by the names that are known where
    /// it is left out. In a biaxial test that of the first axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 200)]
    pub stress_column: Option<String>,
    /// Unit of a stress column whose name does not say it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stress_unit: Option<StressUnit>,
    /// Gauge length in mm, for displacement columns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e6)]
    pub length_mm: Option<f64>,
    /// Area under the force in mm², for force columns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e12)]
    pub area_mm2: Option<f64>,
    /// Columns whose sign is turned: tension and what lengthens are positive, and a file may have it the other way
    /// round. Columns that are called compressive are turned without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turned: Option<Turned>,
}

/// The same of the second axis of biaxial tests.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SecondAxisColumns {
    /// Column of stretch, strain or displacement along the second axis of a biaxial test, by name or number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 200)]
    pub drive_column: Option<String>,
    /// Column of nominal stress or force along the second axis of a biaxial test, by name or number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 200)]
    pub stress_column: Option<String>,
    /// Gauge length along the second axis of a biaxial test in mm; that of the first where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e6)]
    pub length_mm: Option<f64>,
    /// Area under the force along the second axis of a biaxial test in mm²; that of the first where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e12)]
    pub area_mm2: Option<f64>,
}

/// What was read of a curve's file, and what was left out.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub(super) struct CurveReport {
    /// The curve.
    pub(super) name: String,
    /// Rows that are used.
    pub(super) num_rows: usize,
    /// Rows left out because a number is missing.
    pub(super) num_incomplete_rows: usize,
    /// What follows the first loading branch and is left out; none where the test does not go back, or where all
    /// branches are wanted.
    pub(super) unloading: Option<Unloading>,
    /// How the file was understood.
    #[serde(flatten)]
    pub(super) reading: CsvReading,
}

impl CurveReport {
    /// What a reader of the result should know.
    fn in_words(&self) -> String {
        let reading = &self.reading;
        let both = |first: &str, second: &Option<String>| match second {
            Some(second) => format!("{first} and {second}"),
            None => first.to_string(),
        };
        let stresses = both(&reading.stress_column, &reading.second_stress_column);
        let drives = both(&reading.drive_column, &reading.second_drive_column);
        let mut text = format!("{}: {stresses} over {drives}", self.name);
        let mut said = vec![format!("{} rows", self.num_rows)];
        if reading.num_preamble_lines > 0 {
            said.push(format!("{} lines before the header skipped", reading.num_preamble_lines));
        }
        if self.num_incomplete_rows > 0 {
            said.push(format!("{} rows without a number left out", self.num_incomplete_rows));
        }
        text += &format!(", {}\n", said.join(", "));
        if let Some(u) = &self.unloading {
            // Beyond both ends what follows is no way back.
            let work = if (0.0..=1.0).contains(&u.dissipated_part) {
                format!("; the way back gives {} % less work", plain_number(100.0 * u.dissipated_part, 3))
            } else {
                String::new()
            };
            text += &format!(
                "  the test turns at {}: {} rows after that are left out, since an elastic material has one stress for \
                 each state{work} ({BRANCHES} fits all)\n",
                plain_number(u.turn, 4),
                u.num_rows
            );
        }
        text
    }
}

/// How the rows after the first loading branch are kept: option and field.
const BRANCHES: &str = "--all-branches or fit.has_all_branches";

/// What was read, in words.
pub(super) fn reports_in_words(reports: &[CurveReport]) -> String {
    reports.iter().map(CurveReport::in_words).collect::<String>() + "\n"
}

impl CurveColumns {
    fn options(&self) -> CsvOptions {
        CsvOptions {
            drive_column: self.drive_column.clone(),
            stress_column: self.stress_column.clone(),
            stress_unit: self.stress_unit,
            length_mm: self.length_mm,
            area_mm2: self.area_mm2,
            turned: self.turned,
            ..CsvOptions::default()
        }
    }

    /// A curve's text as read; `pointer` is that of the text.
    ///
    /// # Errors
    /// The field and what is wrong with its content.
    pub(super) fn read(&self, csv: &str, test: HomogeneousTest, pointer: &str) -> Result<CsvCurve, FieldError> {
        read_csv(csv, test, &self.options()).map_err(|e| unfit(pointer, &e))
    }
}

/// A curve that cannot be used.
pub(super) fn unfit(pointer: &str, error: &dyn std::fmt::Display) -> FieldError {
    FieldError::new(pointer, "a curve that cannot be used", "a table of a drive and a stress").remedy(error.to_string())
}

/// What a curve does not say that was recorded with another sign: option and field.
const TURNED: &str = "--turned or columns.turned";

/// A curve whose values cannot be.
pub(super) fn unfit_curve(pointer: &str, error: &CurveError) -> FieldError {
    match error {
        CurveError::Sign { .. } => unfit(pointer, &format!("{error} ({TURNED})")),
        _ => unfit(pointer, error),
    }
}

/// A test whose curve is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum CurveTest {
    /// Stretch along one axis, free across. Nominal stress along it.
    Uniaxial,
    /// The same stretch along two axes. Nominal stress along one of them.
    Equibiaxial,
    /// Stretch along one axis, none across (planar tension). Nominal stress along it.
    PureShear,
    /// An amount of shear between plates. Nominal shear stress.
    SimpleShear,
    /// Two stretches that are prescribed independently. Nominal stress along both axes, or along one of them.
    Biaxial,
}

impl CurveTest {
    /// `uniaxial`, `equibiaxial`, `pure_shear`, `simple_shear`, `biaxial`.
    pub fn name(self) -> &'static str {
        self.with_one_drive().map_or("biaxial", HomogeneousTest::name)
    }

    /// The test where one number is its drive; none of a biaxial test.
    pub fn with_one_drive(self) -> Option<HomogeneousTest> {
        match self {
            CurveTest::Uniaxial => Some(HomogeneousTest::Uniaxial),
            CurveTest::Equibiaxial => Some(HomogeneousTest::Equibiaxial),
            CurveTest::PureShear => Some(HomogeneousTest::PureShear),
            CurveTest::SimpleShear => Some(HomogeneousTest::SimpleShear),
            CurveTest::Biaxial => None,
        }
    }
}

/// A test and its curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TestCurve {
    /// The test.
    pub test: CurveTest,
    /// Name in results; the test's where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 200)]
    pub name: Option<String>,
    /// The text of the CSV file.
    #[schema(min_length = 1, max_length = 50000000)]
    pub csv: String,
    /// Predict it instead of fitting it.
    #[serde(default)]
    pub is_kept_back: bool,
}

/// Refuses columns whose unit is not that of a stretch and a stress.
pub(super) fn needs_stress_and_stretch(is_displacement: bool, is_force: bool, pointer: &str) -> Result<(), FieldError> {
    if is_displacement {
        return Err(unfit(pointer, &"the drive is a displacement; give length_mm, or a column of stretch or strain"));
    }
    if is_force {
        return Err(unfit(pointer, &"the stress is a force; give area_mm2, or a column of nominal stress"));
    }
    Ok(())
}

impl TestCurve {
    /// The curves of stretch and stress with what was read: one, or one for each stress of a biaxial test, called
    /// `name`; `pointer` is that of this entry.
    ///
    /// # Errors
    /// The field and what is wrong with its content.
    pub(super) fn curves(
        &self,
        name: &str,
        (columns, second): (&CurveColumns, &SecondAxisColumns),
        fit: &CurveFitSettings,
        pointer: &str,
    ) -> Result<(Vec<Curve>, CurveReport), FieldError> {
        let pointer = format!("{pointer}/csv");
        let shown = self.name.as_deref().unwrap_or(self.test.name());
        let Some(test) = self.test.with_one_drive() else {
            let options = CsvOptions {
                second_drive_column: second.drive_column.clone(),
                second_stress_column: second.stress_column.clone(),
                second_length_mm: second.length_mm,
                second_area_mm2: second.area_mm2,
                ..columns.options()
            };
            return self.biaxial_curves(name, shown, &options, fit, &pointer);
        };
        let mut csv = columns.read(&self.csv, test, &pointer)?;
        needs_stress_and_stretch(csv.is_displacement, csv.is_force, &pointer)?;
        let report = fit.elastic_rows(shown, &mut csv);
        let curve = Curve::new(name, test, &csv.drive, &csv.stress).map_err(|e| unfit_curve(&pointer, &e))?;
        Ok((vec![curve], report))
    }

    fn biaxial_curves(
        &self,
        name: &str,
        shown: &str,
        options: &CsvOptions,
        fit: &CurveFitSettings,
        pointer: &str,
    ) -> Result<(Vec<Curve>, CurveReport), FieldError> {
        let mut csv = read_biaxial_csv(&self.csv, options).map_err(|e| unfit(pointer, &e))?;
        needs_stress_and_stretch(csv.is_displacement, csv.is_force, pointer)?;
        let unloading = if fit.has_all_branches { None } else { csv.take_first_loading() };
        let stresses = csv.stresses.each_ref().map(Option::as_deref);
        let curves = Curve::biaxial(name, &csv.drives, stresses).map_err(|e| unfit_curve(pointer, &e))?;
        let report = CurveReport {
            name: shown.into(),
            num_rows: csv.drives.len(),
            num_incomplete_rows: csv.num_left_out,
            unloading,
            reading: csv.reading,
        };
        Ok((curves, report))
    }
}

/// Settings of fits to curves.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CurveFitSettings {
    /// A law in the first invariant in the place of Ogden's terms. All laws are compared whichever is fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<LawKind>,
    /// Fits with one to this many Ogden terms.
    #[serde(default = "max_terms")]
    #[schema(minimum = 1, maximum = 4, default = max_terms)]
    pub max_terms: usize,
    /// Bulk modulus in kPa, held; the incompressible limit where it is left out, since homogeneous tests do not
    /// determine it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e12)]
    pub bulk_kpa: Option<f64>,
    /// Smallest distance of two exponents.
    #[serde(default = "min_alpha_gap")]
    #[schema(minimum = 0.0, maximum = 40.0, default = min_alpha_gap)]
    pub min_alpha_gap: f64,
    /// Fit all rows of a test that is unloaded again, instead of its first loading branch.
    #[serde(default)]
    pub has_all_branches: bool,
}

fn max_terms() -> usize {
    CurveFitOptions::default().max_terms
}

fn min_alpha_gap() -> f64 {
    CurveFitOptions::default().min_alpha_gap
}

impl Default for CurveFitSettings {
    fn default() -> Self {
        CurveFitSettings {
            law: None,
            max_terms: max_terms(),
            bulk_kpa: None,
            min_alpha_gap: min_alpha_gap(),
            has_all_branches: false,
        }
    }
}

impl CurveFitSettings {
    /// The rows that a fit of an elastic material may use, and what is left out.
    pub(super) fn elastic_rows(&self, name: &str, csv: &mut CsvCurve) -> CurveReport {
        let unloading = if self.has_all_branches { None } else { csv.take_first_loading() };
        CurveReport {
            name: name.into(),
            num_rows: csv.drive.len(),
            num_incomplete_rows: csv.num_left_out,
            unloading,
            reading: csv.reading.clone(),
        }
    }

    pub(super) fn options(&self, neo_hookean: bool) -> CurveFitOptions {
        CurveFitOptions {
            law: self.law,
            max_terms: self.max_terms,
            neo_hookean,
            bulk_kpa: self.bulk_kpa,
            min_alpha_gap: self.min_alpha_gap,
            ..CurveFitOptions::default()
        }
    }
}

/// Adds a fit's `material.json`, and says in the summary what its bulk modulus is where none was held.
pub(super) fn add_material(outcome: &mut Outcome, material: &Result<Material, MaterialError>, is_bulk_held: bool) {
    outcome.summary += &match material {
        Ok(_) if is_bulk_held => String::new(),
        Ok(material) => format!(
            "\nmaterial.json holds a bulk modulus of {} kPa, {BULK_OVER_SHEAR} times the initial shear modulus: the data \
             do not determine it\n",
            plain_number(material.bulk_kpa, 4)
        ),
        Err(error) => format!("\nno material.json: {error}\n"),
    };
    if let Ok(material) = material {
        outcome.add("material.json", material.to_json());
    }
}

/// A fit that failed: its curves are what can be changed.
pub(super) fn fit_failed(error: &dyn std::fmt::Display) -> JobError {
    JobError::NoSolution(error.to_string())
}
