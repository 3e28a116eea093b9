//! The deformed surface for the page's 3D view.

use super::ReportError;
use super::surface::{nodal_values, surface_quads};
use crate::fem::{Equilibrium, ForwardModel};
use crate::kinematics::decompose;
use crate::material::Material;

/// Facets of the surface as JSON: `reference_mm` and `displacement_mm` (twelve numbers per facet), `stretch_amplitude`
/// and `deformation_mode` (one per facet; null where undefined), five digits.
///
/// # Errors
/// [`ReportError`].
pub fn surface_json(model: &ForwardModel, material: &Material, state: &Equilibrium) -> Result<Vec<u8>, ReportError> {
    let fields = model.quadrature_fields(material, state);
    let states: Vec<_> = fields.iter().map(|q| decompose(&q.deformation_gradient)).collect();
    let stretch: Vec<f64> = states.iter().map(|d| d.stretch_amplitude).collect();
    let mode: Vec<f64> = states.iter().map(|d| d.deformation_mode.unwrap_or(f64::NAN)).collect();
    let mean = |nodal: &[f64], corners: [u32; 4]| {
        corners.iter().map(|&v| nodal.get(v as usize).copied().unwrap_or(f64::NAN)).sum::<f64>() / 4.0
    };
    let (stretch, mode) = (nodal_values(model.mesh(), &stretch)?, nodal_values(model.mesh(), &mode)?);
    let quads = surface_quads(model.mesh(), &state.displacement, |_, corners| mean(&stretch, corners));
    let modes = surface_quads(model.mesh(), &state.displacement, |_, corners| mean(&mode, corners));
    let number = |v: f64| if v.is_finite() { Some((v * 1e5).round() / 1e5) } else { None };
    let mut reference = Vec::with_capacity(12 * quads.len());
    let mut displacement = Vec::with_capacity(12 * quads.len());
    for quad in &quads {
        for (r, c) in quad.reference.iter().zip(quad.current) {
            for axis in 0..3 {
                reference.push(number(r[axis]));
                displacement.push(number(c[axis] - r[axis]));
            }
        }
    }
    let value = serde_json::json!({
        "schema": "surface/1",
        "drive_mm": state.drive_mm,
        "reference_mm": reference,
        "displacement_mm": displacement,
        "stretch_amplitude": quads.iter().map(|q| number(q.value)).collect::<Vec<_>>(),
        "deformation_mode": modes.iter().map(|q| number(q.value)).collect::<Vec<_>>(),
    });
    Ok(value.to_string().into_bytes())
}
