//! What one scan of a specimen would tell about the material.
//!
//! ```text
//! cargo run --release --example evaluate
//! ```

use lambdak::prelude::*;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let specimen = Specimen::from_json(include_str!("../geometries/solid-shear.json"))?;
    let material = Material::new(2200.0, [(16.0, 1.9), (0.35, 8.0)])?;
    let scan = ScanSettings { voxel_mm: [1.0, 0.4, 1.0], ..ScanSettings::default() };
    let options = EvaluationOptions { mesh: MeshOptions::search(&specimen), ..EvaluationOptions::standard(&specimen) };
    let drives = DriveSelection::DriveMm(specimen.drive_mm.clone());
    let (evaluation, _) = evaluate(&specimen, &material, &scan, &drives, &options, &|| false)?;
    for promised in &evaluation.promised_sd {
        match promised.relative_sd {
            Some(sd) => println!("{}: known to {:.2} %", promised.parameter, 100.0 * sd),
            None => println!("{}: not determined", promised.parameter),
        }
    }
    Ok(())
}
