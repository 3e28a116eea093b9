//! Forces that are compared, those read on the way to a scan among them, and what is unknown of the load cell.
//!
//! A load cell's gain and zero are common to all its readings, those of several recordings too. With what is known of
//! them beforehand, readings F have the covariance C = diag(σ²) + σ_gain² F Fᵀ + σ_zero² 1 1ᵀ; weighing them by C⁻¹
//! ([`super::all_forces`]) is the same as estimating gain and zero beside the material.

use crate::sensitivity::Protocol;

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
}

#[cfg(test)]
#[path = "force_readings_tests.rs"]
mod tests;
