//! Settings of a diagnosis.

use super::cause::CauseName;
use super::error::DiagnosisError;
use crate::calibration::Boundary;
use crate::material::Material;

/// Settings of [`super::diagnose()`].
#[derive(Clone, Debug)]
pub struct DiagnosisOptions {
    /// Element size as a factor on the standard one, from 0.3 to 5.
    pub mesh_factor: f64,
    /// The displacement error that meshes may leave, mm rms at the largest drive; `None` for a thousandth of that
    /// drive.
    pub allowance_mm: Option<f64>,
    /// The material as believed; its number of terms is then the nominal one.
    pub prior: Option<Material>,
    /// Most causes that the displacement is fitted with: no round begins once the count is reached. Effects that the
    /// load curve tells of do not count (they may go again, once it is known what the displacement tells), nor do
    /// artefacts of the image.
    pub max_causes: usize,
    /// Drift of the load cell where the recording does not state it, N.
    pub force_sd_n: f64,
    /// What moves the boundary of the model. Where it is what was measured, no cause at the boundary is looked for.
    pub boundary: Boundary,
    /// Causes that are not to be supposed, neither by themselves nor as special cases of others.
    pub left_out: Vec<CauseName>,
}

impl Default for DiagnosisOptions {
    fn default() -> Self {
        DiagnosisOptions {
            mesh_factor: 1.8,
            allowance_mm: None,
            prior: None,
            max_causes: 6,
            force_sd_n: 0.02,
            boundary: Boundary::Commanded,
            left_out: Vec::new(),
        }
    }
}

impl DiagnosisOptions {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`DiagnosisError::Setting`] with the first setting that is out of its range.
    pub fn check(&self) -> Result<(), DiagnosisError> {
        if (0.3..=5.0).contains(&self.mesh_factor) {
            return Ok(());
        }
        Err(DiagnosisError::Setting { name: "the mesh factor", value: self.mesh_factor, requirement: "from 0.3 to 5" })
    }
}
