//! The residual and tangent of the last assembly, with what a Newton step needs of them.

use super::condensation::Condensation;
use super::equilibrium::Serial;
use super::linear::LinearSystem;

/// Residual and tangent at one state. Assembled anew in the same memory at every Newton iteration.
pub(super) struct Linearisation {
    /// The tangent, and a factor of it or of one assembled earlier.
    pub(super) system: LinearSystem,
    /// Residual at every node, springs included, kPa·mm².
    pub(super) residual: Vec<[f64; 3]>,
    /// Forces of the springs at released nodes, kPa·mm².
    pub(super) spring_forces: Vec<(u32, [f64; 3])>,
    /// What the update of the pressures needs, per element.
    pub(super) condensation: Vec<Condensation>,
    /// Whether the tangent is that of the state whose residual this is, and not of an earlier one.
    pub(super) has_tangent: bool,
    /// Relative residual of the state whose tangent was last factorised by Newton's method.
    pub(super) factorised_at: f64,
    /// The equilibrium whose residual this is, if it is that of one.
    pub(super) stands_at: Option<Serial>,
}

impl Linearisation {
    /// Nothing assembled; memory is taken at the first assembly.
    pub(super) fn new(system: LinearSystem) -> Linearisation {
        Linearisation {
            system,
            residual: Vec::new(),
            spring_forces: Vec::new(),
            condensation: Vec::new(),
            has_tangent: false,
            factorised_at: f64::INFINITY,
            stands_at: None,
        }
    }
}
