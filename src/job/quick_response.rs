//! Force and stretch of a specimen at its largest drive, on the search's mesh: what a check before any job can tell.

use super::cost::seconds_per_drive;
use crate::fem::{ForwardModel, SolveOptions};
use crate::kinematics::decompose;
use crate::material::Material;
use crate::mesh::{MeshOptions, mesh_specimen};
use crate::specimen::{Specimen, TestResponse};

/// What takes longer is not solved for a check, s.
const MOST_SECONDS: f64 = 2.0;

/// Why there is no response.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NoResponse {
    /// It would take too long for a check.
    #[error(
        "solving it would take about {seconds:.0} s, more than a check takes ({MOST_SECONDS} s); start an evaluation"
    )]
    TooSlow {
        /// Estimate, s.
        seconds: f64,
    },
    /// There is no drive.
    #[error("the specimen has no drive")]
    NoDrive,
    /// Meshing or solving failed.
    #[error("{0}")]
    Failed(String),
}

/// Solves `specimen` at its largest drive; the local stretch is the largest at any quadrature point.
///
/// # Errors
/// [`NoResponse`].
pub fn quick_response(specimen: &Specimen, material: &Material) -> Result<TestResponse, NoResponse> {
    let failed = |e: &dyn std::fmt::Display| NoResponse::Failed(e.to_string());
    let drive = specimen.largest_drive_mm();
    if !(drive.abs() > 0.0) {
        return Err(NoResponse::NoDrive);
    }
    let samples = specimen.samples();
    let mut seconds = 0.0;
    for sample in &samples {
        let mesh = mesh_specimen(sample, &MeshOptions::search(sample)).map_err(|e| failed(&e))?;
        seconds += seconds_per_drive(mesh.nodes.len(), 0);
    }
    if seconds > MOST_SECONDS {
        return Err(NoResponse::TooSlow { seconds });
    }
    let normal_force_n = specimen.has_plates().then_some(0.0);
    let mut response = TestResponse { drive_mm: drive, force_n: 0.0, normal_force_n, local_stretch: f64::NEG_INFINITY };
    for sample in &samples {
        let options = MeshOptions::search(sample);
        let mut model = ForwardModel::of_specimen(sample, &options).map_err(|e| failed(&e))?;
        let found = model.solve(material, drive, None, &SolveOptions::default(), &|| false).map_err(|e| failed(&e))?;
        response.force_n += found.force_n;
        response.normal_force_n = response.normal_force_n.map(|sum| sum + found.normal_force_n);
        let stretches = model.quadrature_fields(material, &found);
        let stretches = stretches.iter().map(|q| decompose(&q.deformation_gradient).principal_stretches[0]);
        response.local_stretch = stretches.fold(response.local_stretch, f64::max);
    }
    Ok(response)
}
