//! The elastic force of a sample over its drive.

use super::error::DiagnosisError;
use crate::rate::ForceTable;

/// Elastic force in the direction of the drive over the distance from rest, with its derivatives with respect to scaled
/// material parameters. It is of the way that the recorded steps go.
pub struct ElasticTable {
    /// F∞ over drive, N.
    pub(super) force: ForceTable,
    /// Its derivatives, N.
    pub(super) derivatives: Vec<ForceTable>,
    /// W = ∫ F∞ dd over drive, N mm.
    pub(super) work: ForceTable,
}

impl ElasticTable {
    /// From forces (N) and derivatives at rising distances (mm) that start at zero.
    ///
    /// # Errors
    /// [`DiagnosisError::Setting`] where the drives do not rise.
    pub fn new(drives_mm: &[f64], forces_n: &[f64], derivatives: &[Vec<f64>]) -> Result<ElasticTable, DiagnosisError> {
        let table = |values: &[f64]| {
            ForceTable::new(drives_mm, values).map_err(|_| DiagnosisError::Setting {
                name: "the number of drives of the load curve's table",
                value: drives_mm.len() as f64,
                requirement: "at least two rising drives",
            })
        };
        let force = table(forces_n)?;
        let mut work = vec![0.0];
        for pair in 0..drives_mm.len().saturating_sub(1) {
            let mean = 0.5 * (forces_n[pair] + forces_n[pair + 1]);
            work.push(work[pair] + mean * (drives_mm[pair + 1] - drives_mm[pair]));
        }
        Ok(ElasticTable {
            force,
            derivatives: derivatives.iter().map(|d| table(d)).collect::<Result<_, _>>()?,
            work: table(&work)?,
        })
    }

    /// A table's value at a drive of either sign, mm; beyond the table that of its end.
    pub(super) fn at(table: &ForceTable, drive: f64) -> f64 {
        // The response to the other direction is the mirror image.
        let limit = table.range()[1];
        let value = table.at(drive.abs().min(limit)).map_or(0.0, |v| v.0);
        value * drive.signum()
    }
}
