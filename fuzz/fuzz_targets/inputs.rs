//! Specimens, materials, limits and studies as text.
#![no_main]

use lambdak::design::Study;
use lambdak::material::Material;
use lambdak::specimen::{ManufacturingLimits, Specimen};
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    if let Ok(specimen) = Specimen::from_json(text) {
        specimen.validate().expect("what is read is valid");
        let again = serde_json::to_string(&specimen).expect("a specimen is JSON");
        assert_eq!(Specimen::from_json(&again).expect("what is written is read"), specimen);
    }
    if let Ok(material) = Material::from_json(text) {
        let again = serde_json::to_string(&material).expect("a material is JSON");
        assert_eq!(Material::from_json(&again).expect("what is written is read"), material);
    }
    let _ = ManufacturingLimits::from_json(text);
    // A study names other files; there are none.
    let _ = Study::from_json(text, Path::new("/nonexistent"));
});
