//! What one scan tells about an exponent, by how the published block is meshed toward and along its plates: the table in
//! docs/design-study.md.
//!
//! ```text
//! cargo run --release --example mesh_of_edges
//! ```

use lambdak::fem::{ForwardModel, SolveOptions};
use lambdak::prelude::*;
use lambdak::sensitivity::Scanner;
use lambdak::voxel::Sampling;

/// Element size along the plates as a factor on the standard one, layers between the plates, grading.
const MESHES: [(f64, usize, f64); 9] = [
    (1.4, 4, 0.3),
    (1.0, 5, 0.3),
    (0.7, 7, 0.3),
    (0.5, 10, 0.3),
    (1.0, 10, 0.1),
    (1.0, 15, 0.03),
    (0.5, 10, 0.1),
    (0.7, 14, 0.1),
    (0.7, 14, 0.03),
];
const DRIVE_MM: f64 = 7.0;
const NOISE_SD_MM: f64 = 0.05;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let specimen = Specimen::from_json(include_str!("../geometries/two-hole-shear.json"))?;
    let (bulk_kpa, mu_kpa, alpha) = (2173.0, 17.0, 1.91);
    let material = Material::new(bulk_kpa, [(mu_kpa, alpha)])?;
    let scan = ScanSettings {
        voxel_mm: [1.0, 0.1875, 0.75],
        noise_sd_mm: [NOISE_SD_MM; 3],
        force_sd_n: 0.02,
        partial_voxels: PartialVoxels::default(),
        surface: None,
    };
    println!("size  layers  grading  elements  information of the displacements about ln alpha");
    for (factor, levels, grading) in MESHES {
        let options = MeshOptions { levels, grading, ..MeshOptions::scaled(&specimen, factor) };
        let mut model = ForwardModel::of_specimen(&specimen, &options)?;
        let scanner = Scanner::new(&specimen, model.mesh(), &scan, Sampling::default())?;
        let found = match model.solve_path(&material, &[DRIVE_MM], &SolveOptions::default(), &|| false) {
            Ok(path) => {
                let sensitivities = model.tangent(&material, &path[0])?.material_sensitivities()?;
                // κ, μ, α.
                let voxels = scanner.operator.average(&sensitivities[2].displacement)?;
                let squares: f64 = voxels.iter().flatten().map(|s| s * s).sum();
                format!("{:.0}", squares * (alpha / NOISE_SD_MM).powi(2))
            }
            Err(error) => error.to_string(),
        };
        println!("{factor:<5} {levels:>6}  {grading:>7}  {:>8}  {found}", model.mesh().num_elements());
    }
    Ok(())
}
