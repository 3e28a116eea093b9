//! How finely a design is solved while it is searched for.

use crate::mesh::MeshOptions;
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};

/// Element size along the plates of the coarse mesh, as a factor on the standard one.
const COARSE_FACTOR: f64 = 2.5;
/// Of the fine one: the finest of a confirmation, so that what it solves has an equilibrium on all of these.
const FINE_FACTOR: f64 = 1.4;

/// How finely a design is solved while it is searched for. Integrated sensitivities hardly differ between the two;
/// promised standard deviations of several terms do, and not by the same from design to design. Samples are coarse,
/// proposals fine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fidelity {
    /// For samples, which say where to look.
    Coarse,
    /// For what the search ends with.
    Fine,
}

impl Fidelity {
    /// Element size along the plates, as a factor on the standard one.
    pub(super) fn factor(self) -> f64 {
        match self {
            Fidelity::Coarse => COARSE_FACTOR,
            Fidelity::Fine => FINE_FACTOR,
        }
    }

    /// The mesh, graded and layered as a confirmation's: what edges and free faces do on other meshes is not what they
    /// do there.
    pub fn mesh_options(self, specimen: &Specimen) -> MeshOptions {
        let options = MeshOptions::graded(specimen, self.factor());
        match self {
            Fidelity::Coarse => MeshOptions { hole_segments: 8, ..options },
            // Walls of holes fold where enough elements lie along them.
            Fidelity::Fine => options,
        }
    }
}
