//! Forces that are compared, those read on the way to a scan among them, and what is unknown of the load cell.
//!
//! A load cell's gain and zero are common to all its readings. With what is known of them beforehand, readings F have
//! the covariance C = diag(σ²) + σ_gain² F Fᵀ + σ_zero² 1 1ᵀ; weighing them by C⁻¹ is the same as estimating gain and
//! zero beside the material.

use crate::sensitivity::Protocol;
use nalgebra::{DMatrix, DVector};

/// A force with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservedForce {
    /// All samples together, N.
    pub value_n: f64,
    /// Standard deviation, N.
    pub sd_n: f64,
}

/// A force read at a drive at which nothing was scanned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceOnTheWay {
    /// The drive, mm.
    pub drive_mm: f64,
    /// The force.
    pub force: ObservedForce,
}

/// What is unknown of the load cell, alike for all its readings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoadCell {
    /// Standard deviation of its gain, as a part of the force.
    pub gain_sd: f64,
    /// Standard deviation of its zero, N.
    pub zero_sd_n: f64,
}

impl LoadCell {
    /// That of a protocol.
    pub fn of_protocol(protocol: &Protocol) -> LoadCell {
        LoadCell { gain_sd: protocol.force_gain_sd, zero_sd_n: protocol.force_zero_sd_n }
    }

    /// Variance (N²) that gain and zero give a reading of `force_n`.
    pub fn variance_n2(&self, force_n: f64) -> f64 {
        (self.gain_sd * force_n).powi(2) + self.zero_sd_n * self.zero_sd_n
    }

    /// C (N²) of readings `forces_n` with the standard deviations `sd_n` of their own.
    pub(super) fn covariance(&self, forces_n: &[f64], sd_n: &[f64]) -> DMatrix<f64> {
        let mut covariance = DMatrix::from_diagonal(&DVector::from_iterator(sd_n.len(), sd_n.iter().map(|s| s * s)));
        for (i, a) in forces_n.iter().enumerate() {
            for (j, b) in forces_n.iter().enumerate() {
                covariance[(i, j)] += (self.gain_sd * a) * (self.gain_sd * b) + self.zero_sd_n * self.zero_sd_n;
            }
        }
        covariance
    }

    /// C⁻¹ (N⁻²) of the same. Readings have standard deviations above zero, so that C is positive definite.
    pub(super) fn precision(&self, forces_n: &[f64], sd_n: &[f64]) -> DMatrix<f64> {
        // W = D − D B (I + Bᵀ D B)⁻¹ Bᵀ D with D = diag(1/σ²) and B = [σ_gain F, σ_zero 1] (Woodbury).
        let num = sd_n.len();
        let own = DVector::from_iterator(num, sd_n.iter().map(|s| 1.0 / (s * s)));
        let shared = DMatrix::from_fn(num, 2, |i, a| if a == 0 { self.gain_sd * forces_n[i] } else { self.zero_sd_n });
        let weighed = DMatrix::from_fn(num, 2, |i, a| own[i] * shared[(i, a)]);
        let inner = DMatrix::identity(2, 2) + shared.transpose() * &weighed;
        let mut precision = DMatrix::from_diagonal(&own);
        // I + something positive has an inverse.
        if let Some(inverse) = inner.try_inverse() {
            precision -= &weighed * inverse * weighed.transpose();
        }
        precision
    }
}

#[cfg(test)]
#[path = "force_readings_tests.rs"]
mod tests;
