//! Transverse isotropy: the sample is stiffer along one direction.

use crate::diagnosis::candidate::Candidate;
use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::error::DiagnosisError;
use crate::diagnosis::fibre_map::{FibreDirection, fibre_directions};
use crate::diagnosis::prior::shear_modulus;
use crate::diagnosis::scene::Scene;
use crate::diagnosis::search::Search;
use crate::fem::Fibre;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("fibre");
/// What a laboratory can do about it.
const REMEDY: &str = "Test samples cut along two directions, and use a material with fibres.";
/// Its line in the registry.
pub(super) const ENTRY: Entry = Entry { name: NAME, remedy: REMEDY, origin: Origin::Searched(suspects) };

/// Fibres near a direction.
pub struct Fibres {
    direction: [f64; 3],
    /// Two unit vectors across it, along which the direction may turn.
    across: [[f64; 3]; 2],
    shear_modulus_kpa: f64,
}

/// Fibres along the directions that explain most; none where the sample has fibres already.
fn suspects(search: &mut Search) -> Result<Vec<Candidate>, DiagnosisError> {
    let (material, scene) = (&search.current.material, search.current.scene());
    if scene.fibre.is_some() {
        return Ok(Vec::new());
    }
    let found = fibre_directions(search.laboratory, material, &scene, &search.current.prediction, search.test)?;
    let modulus_kpa = shear_modulus(material);
    Ok(found
        .into_iter()
        .map(|FibreDirection { explained, direction, modulus_kpa: start_kpa }| Candidate {
            cause: Arc::new(Fibres::along(direction, modulus_kpa)),
            values: vec![start_kpa, 0.0, 0.0],
            score: explained,
        })
        .collect())
}

fn unit(a: [f64; 3]) -> [f64; 3] {
    let n = a.iter().map(|x| x * x).sum::<f64>().sqrt();
    a.map(|x| x / n)
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

impl Fibres {
    /// Along `direction`, in a sample of this initial shear modulus.
    pub fn along(direction: [f64; 3], shear_modulus_kpa: f64) -> Fibres {
        let smallest = (0..3).min_by(|&a, &b| direction[a].abs().total_cmp(&direction[b].abs())).unwrap_or(0);
        let mut axis = [0.0; 3];
        axis[smallest] = 1.0;
        let first = unit(cross(direction, axis));
        Fibres { direction, across: [first, cross(direction, first)], shear_modulus_kpa }
    }

    fn direction(&self, values: &[f64]) -> [f64; 3] {
        let (a, b) = (values[1].to_radians().tan(), values[2].to_radians().tan());
        unit([0, 1, 2].map(|i| self.direction[i] + a * self.across[0][i] + b * self.across[1][i]))
    }
}

impl Cause for Fibres {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Material
    }

    fn description(&self) -> String {
        let [x, y, z] = self.direction;
        format!("the sample is stiffer along one direction, near ({x:.2}, {y:.2}, {z:.2})")
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        let g = self.shear_modulus_kpa;
        vec![
            CauseParameter::new("modulus_kpa", 0.1 * g, [-0.05 * g, 20.0 * g]),
            CauseParameter::new("turn_1_degrees", 10.0, [-60.0, 60.0]),
            CauseParameter::new("turn_2_degrees", 10.0, [-60.0, 60.0]),
        ]
    }

    /// The components of the direction in hundredths.
    fn variant(&self) -> [i64; 3] {
        self.direction.map(|x| (100.0 * x).round() as i64)
    }

    fn max_suspects(&self) -> usize {
        2
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        scene.fibre = Some(Fibre { direction: self.direction(values), modulus_kpa: values[0] });
    }
}
