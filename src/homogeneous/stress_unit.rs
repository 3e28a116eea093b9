//! Units of stress.

/// A unit of stress: of a column of stresses whose name does not say it, or of what is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
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
