//! The fields of an equilibrium that are written to files: the one list of them, with names and units.

use super::solution_field::{FieldPlace, SolutionField};
use super::vtu::element_means;
use crate::fem::{Equilibrium, ForwardModel, QuadraturePoint};
use crate::kinematics::decompose;
use crate::material::Material;

const VECTOR: &[&str] = &["component"];
const TENSOR: &[&str] = &["row", "column"];

/// The fields of an equilibrium: displacement at the nodes; F, J, principal stretches, λ, k and σ as element means.
/// J, stretches, λ and k are those of the mean of F.
pub fn solution_fields(model: &ForwardModel, material: &Material, state: &Equilibrium) -> Vec<SolutionField> {
    let fields = model.quadrature_fields(material, state);
    let mean = |value: &dyn Fn(&QuadraturePoint) -> [[f64; 3]; 3]| -> Vec<[f64; 9]> {
        let flat = |t: [[f64; 3]; 3]| [t[0][0], t[0][1], t[0][2], t[1][0], t[1][1], t[1][2], t[2][0], t[2][1], t[2][2]];
        let samples = fields.iter().map(|q| (q.element, q.volume_mm3, flat(value(q))));
        element_means(model.mesh().num_elements(), samples)
    };
    let gradients = mean(&|q| q.deformation_gradient);
    let stresses = mean(&|q| q.cauchy_stress);
    let tensor = |v: &[f64; 9]| [[v[0], v[1], v[2]], [v[3], v[4], v[5]], [v[6], v[7], v[8]]];
    let states: Vec<_> = gradients.iter().map(|g| decompose(&tensor(g))).collect();
    let on_elements = |name, unit, about, axes, values| SolutionField {
        name,
        unit,
        about,
        place: FieldPlace::Elements,
        axes,
        values,
    };
    vec![
        SolutionField {
            name: "displacement_mm",
            unit: "mm",
            about: "displacement u",
            place: FieldPlace::Nodes,
            axes: VECTOR,
            values: state.displacement.iter().flatten().copied().collect(),
        },
        on_elements("deformation_gradient", "1", "deformation gradient F", TENSOR, gradients.concat()),
        on_elements("jacobian", "1", "J = det F", &[], states.iter().map(|d| d.jacobian).collect()),
        on_elements(
            "principal_stretches",
            "1",
            "principal stretches, largest first, with the change of volume",
            VECTOR,
            states.iter().flat_map(|d| d.principal_stretches).collect(),
        ),
        on_elements(
            "stretch_amplitude",
            "1",
            "stretch amplitude lambda",
            &[],
            states.iter().map(|d| d.stretch_amplitude).collect(),
        ),
        on_elements(
            "deformation_mode",
            "1",
            "deformation mode k: 0 equibiaxial, 1/2 pure shear, 1 uniaxial; NaN without a stretch",
            &[],
            states.iter().map(|d| d.deformation_mode.unwrap_or(f64::NAN)).collect(),
        ),
        on_elements("cauchy_stress_kpa", "kPa", "Cauchy stress", TENSOR, stresses.concat()),
    ]
}
