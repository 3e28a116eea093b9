//! The look for suspects with a place or a direction: what causes ask of the recording in one round.

use super::cause_fit::CauseFit;
use super::error::DiagnosisError;
use super::laboratory::Laboratory;
use super::maps::{BondMap, ScoreMap, StiffnessMap};
use super::score::ScoreTest;

/// What a cause may ask where it looks for its suspects. Maps are made when the first cause asks for them, and kept.
pub(super) struct Search<'s, 'a> {
    /// What predicts the recording.
    pub(super) laboratory: &'s mut Laboratory<'a>,
    /// The fit so far.
    pub(super) current: &'s CauseFit,
    /// The score test of what that fit leaves, with the material and the causes so far free.
    pub(super) test: &'s ScoreTest<'s>,
    /// Whether the work is to stop.
    pub(super) is_cancelled: &'s (dyn Fn() -> bool + Sync),
    /// The most that a suspect of this round explains so far, to first order. Causes are asked in the order of the
    /// registry.
    pub(super) top: f64,
    bonds: Option<[BondMap; 2]>,
    stiffness: Option<StiffnessMap>,
}

impl<'s, 'a> Search<'s, 'a> {
    /// Nothing looked at yet.
    pub(super) fn new(
        laboratory: &'s mut Laboratory<'a>,
        current: &'s CauseFit,
        test: &'s ScoreTest<'s>,
        is_cancelled: &'s (dyn Fn() -> bool + Sync),
    ) -> Search<'s, 'a> {
        Search { laboratory, current, test, is_cancelled, top: 0.0, bonds: None, stiffness: None }
    }

    /// Maps of the compliance of the fixed and the moved face.
    ///
    /// # Errors
    /// [`DiagnosisError`].
    pub(super) fn bond_maps(&mut self) -> Result<&Option<[BondMap; 2]>, DiagnosisError> {
        if self.bonds.is_none() {
            let (material, scene, prediction) =
                (&self.current.material, &self.current.scene(), &self.current.prediction);
            let fixed = BondMap::new(self.laboratory, material, scene, prediction, self.test, false)?;
            let moved = BondMap::new(self.laboratory, material, scene, prediction, self.test, true)?;
            self.bonds = Some([fixed, moved]);
        }
        Ok(&self.bonds)
    }

    /// The map of modulus changes.
    ///
    /// # Errors
    /// [`DiagnosisError`].
    pub(super) fn stiffness_map(&mut self) -> Result<&Option<StiffnessMap>, DiagnosisError> {
        if self.stiffness.is_none() {
            let (material, scene, prediction) =
                (&self.current.material, &self.current.scene(), &self.current.prediction);
            self.stiffness = Some(StiffnessMap::new(self.laboratory, material, scene, prediction, self.test)?);
        }
        Ok(&self.stiffness)
    }

    /// All maps with their names, also those that no cause asked for.
    ///
    /// # Errors
    /// [`DiagnosisError`].
    pub(super) fn into_maps(mut self) -> Result<Vec<(String, ScoreMap)>, DiagnosisError> {
        self.bond_maps()?;
        self.stiffness_map()?;
        let mut all = Vec::new();
        if let Some([fixed, moved]) = self.bonds {
            all.push(("bond of the fixed plate".into(), fixed.map));
            all.push(("bond of the moved plate".into(), moved.map));
        }
        all.extend(self.stiffness.map(|s| ("stiffness of the sample".into(), s.map)));
        Ok(all)
    }
}
