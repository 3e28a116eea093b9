//! Another mesh of a recording's sample, on which what ours predicts is predicted again.

use super::cause_fit::CauseFit;
use super::error::DiagnosisError;
use super::laboratory::Laboratory;
use super::trace::Trace;
use crate::fem::{Equilibrium, ForwardModel, Nesting};
use crate::mesh::MeshOptions;

/// A mesh of its own, with how it lies in ours.
pub(super) struct OtherMesh<'a> {
    laboratory: Laboratory<'a>,
    /// How its mesh lies in ours; `None` where it does not.
    nesting: Option<Nesting>,
    /// What was last predicted of a scene on our mesh and on this one.
    known: Option<[Vec<Equilibrium>; 2]>,
}

impl<'a> OtherMesh<'a> {
    /// Of the sample that `ours` looks at.
    ///
    /// # Errors
    /// [`DiagnosisError`]: it cannot be meshed so.
    pub(super) fn new(ours: &Laboratory<'a>, mesh: &MeshOptions) -> Result<OtherMesh<'a>, DiagnosisError> {
        let laboratory = Laboratory::new(ours.observed(), mesh)?;
        let nesting = Nesting::located(ours.nominal_mesh(), laboratory.nominal_mesh());
        Ok(OtherMesh { laboratory, nesting, known: None })
    }

    /// What this mesh predicts beyond ours of a fit, whose model on our mesh is `ours`. Its equilibria start from those
    /// on our mesh.
    ///
    /// # Errors
    /// [`DiagnosisError`]: the model has no equilibrium here, or the work was cancelled.
    pub(super) fn beyond(
        &mut self,
        ours: &ForwardModel,
        fitted: &CauseFit,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Trace, DiagnosisError> {
        let (material, scene, predicted) = (&fitted.material, fitted.scene(), &fitted.prediction);
        // A sample with a cut has another mesh.
        let nesting = self.nesting.as_ref().filter(|_| scene.cut.is_none());
        if let Some(nesting) = nesting {
            self.laboratory.start_from(ours, nesting, material, &scene, &predicted.states, self.known.as_ref())?;
        }
        let theirs = self.laboratory.predict(material, &scene, is_cancelled)?;
        self.known = nesting.map(|_| [predicted.states.clone(), theirs.states]);
        Ok(theirs.trace.plus(-1.0, &predicted.trace))
    }
}
