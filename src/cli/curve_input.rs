//! Curves from files, for the commands that fit them.

use super::error::CliError;
use super::input::read_text;
use crate::homogeneous::{CsvCurve, CsvOptions, Curve, CurveFitOptions, HomogeneousTest, StressUnit, read_csv};
use clap::Args;
use std::path::Path;

/// How columns are understood.
#[derive(Args)]
pub(super) struct ColumnArguments {
    /// Column of stretch, strain, shear or displacement [default: by its name].
    #[arg(long, value_name = "NAME")]
    drive_column: Option<String>,
    /// Column of nominal stress or force [default: by its name].
    #[arg(long, value_name = "NAME")]
    stress_column: Option<String>,
    /// Unit of a stress column whose name does not say it: pa, kpa or mpa.
    #[arg(long)]
    stress_unit: Option<String>,
    /// Gauge length in mm, for displacement columns.
    #[arg(long)]
    length: Option<f64>,
    /// Area under the force in mm², for force columns.
    #[arg(long)]
    area: Option<f64>,
}

impl ColumnArguments {
    pub(super) fn options(&self) -> Result<CsvOptions, CliError> {
        let stress_unit = match self.stress_unit.as_deref().map(str::to_ascii_lowercase).as_deref() {
            None => None,
            Some("pa") => Some(StressUnit::Pa),
            Some("kpa") => Some(StressUnit::KPa),
            Some("mpa") => Some(StressUnit::MPa),
            Some(other) => {
                let message = format!("'{other}' is not pa, kpa or mpa");
                return Err(CliError::Option { option: "stress-unit", message });
            }
        };
        Ok(CsvOptions {
            drive_column: self.drive_column.clone(),
            stress_column: self.stress_column.clone(),
            stress_unit,
            length_mm: self.length,
            area_mm2: self.area,
        })
    }
}

/// Settings of the fits.
#[derive(Args)]
pub(super) struct FitArguments {
    /// Fits with one to this many Ogden terms (1 to 4).
    #[arg(long, default_value_t = 3)]
    pub(super) terms: usize,
    /// Bulk modulus in kPa, held [default: the incompressible limit; homogeneous tests do not determine it].
    #[arg(long, value_name = "KPA")]
    bulk: Option<f64>,
    /// Smallest distance of two exponents.
    #[arg(long, default_value_t = 1.0)]
    min_alpha_gap: f64,
}

impl FitArguments {
    pub(super) fn options(&self, neo_hookean: bool) -> CurveFitOptions {
        CurveFitOptions {
            max_terms: self.terms,
            neo_hookean,
            bulk_kpa: self.bulk,
            min_alpha_gap: self.min_alpha_gap,
            ..CurveFitOptions::default()
        }
    }
}

/// A curve file as read.
pub(super) fn read_curve(path: &Path, test: HomogeneousTest, options: &CsvOptions) -> Result<CsvCurve, CliError> {
    let text = read_text(path)?;
    read_csv(&text, test, options).map_err(|e| CliError::Input { path: path.into(), message: e.to_string() })
}

/// A curve file whose columns give stretch and stress.
pub(super) fn read_stretch_curve(path: &Path, test: HomogeneousTest, options: &CsvOptions) -> Result<Curve, CliError> {
    let csv = read_curve(path, test, options)?;
    let bad = |message: &str| CliError::Input { path: path.into(), message: message.into() };
    if csv.is_displacement {
        return Err(bad("the drive is a displacement; give --length, or a column of stretch or strain"));
    }
    if csv.is_force {
        return Err(bad("the stress is a force; give --area, or a column of nominal stress"));
    }
    Curve::new(test.name(), test, &csv.drive, &csv.stress).map_err(|e| bad(&e.to_string()))
}
