//! The material, mesh and scan that are taken where a request leaves them out.

use crate::material::Material;
use crate::sensitivity::ScanSettings;
use crate::specimen::Specimen;

/// Ecoflex 00-20 as calibrated in the paper: κ 2173 kPa, μ₁ 17.0 kPa, α₁ 1.91.
pub fn ecoflex() -> Material {
    shipped(Material::from_json(include_str!("../../geometries/materials/ecoflex-0020.json")))
}

/// The published two-hole double-lap shear specimen.
pub fn two_hole_shear() -> Specimen {
    shipped(Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")))
}

/// The ISO 37 type 4 dumb-bell.
pub fn dumbbell() -> Specimen {
    shipped(Specimen::from_json(include_str!("../../geometries/iso37-type4.json")))
}

/// The paper's voxels, 1 × 0.1875 × 0.75 mm; 0.05 mm and 0.02 N noise.
pub fn scan() -> ScanSettings {
    ScanSettings::default()
}

/// Edges of the paper's voxels, mm.
pub fn voxel_mm() -> [f64; 3] {
    scan().voxel_mm
}

/// Standard deviation of a load cell's mean, N.
pub fn force_sd_n() -> f64 {
    scan().force_sd_n
}

/// The shipped bar.
pub(super) fn uniaxial_bar() -> Specimen {
    shipped(Specimen::from_json(include_str!("../../geometries/uniaxial-bar.json")))
}

/// An identifier as recordings have them, for examples of requests.
pub(super) const EXAMPLE_RECORDING: &str = "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08";

/// Stretches and nominal stresses of a neo-Hookean strip of 10 kPa, for examples of requests.
pub(super) fn example_curve() -> String {
    let row = |stretch: f64| format!("{stretch:.2},{:.3}\n", 10.0 * (stretch - stretch.powi(-2)));
    (0..15).fold("stretch,nominal_stress_kpa\n".into(), |text, n| text + &row(1.0 + 0.05 * f64::from(n)))
}

/// The same with times.
pub(super) fn example_history() -> String {
    let lines = example_curve();
    let timed = lines.lines().enumerate().skip(1).map(|(n, line)| format!("{n},{line}\n"));
    format!("time_s,{}\n{}", lines.lines().next().unwrap_or_default(), timed.collect::<String>())
}

/// A shipped study with its specimen and one material spelled out, as requests hold them.
pub(super) fn spelled_out(study: &str, base: &Specimen) -> serde_json::Value {
    let mut study: serde_json::Value = shipped(serde_json::from_str(study));
    study["base"] = serde_json::json!(base);
    study["materials"] = serde_json::json!([{ "name": "Ecoflex 00-20", "material": ecoflex() }]);
    study
}

/// Yes.
pub fn yes() -> bool {
    true
}

/// A file that is part of the program; a test reads them all.
fn shipped<T, E: std::fmt::Display>(read: Result<T, E>) -> T {
    match read {
        Ok(value) => value,
        Err(error) => unreachable!("a shipped file is damaged: {error}"),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn shipped_files_can_be_read() {
        assert_eq!(super::ecoflex().terms.len(), 1);
        assert_eq!(super::two_hole_shear().holes.len(), 2);
        assert!(super::dumbbell().holes.is_empty());
    }
}
