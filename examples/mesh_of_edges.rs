//! What one scan tells about an exponent, by how the published block is meshed toward and along its plates, and by
//! whether a layer of elements of the same depth lies along the free faces of every block: tables in
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
/// Length, thickness, width, and places along the block and diameter of two holes, all mm: the published block, and two
/// others.
const BLOCKS: [([f64; 3], f64, f64); 4] = [
    ([25.4, 6.4, 19.1], 4.2333, 5.0),
    ([29.5, 6.8, 21.4], 7.3, 4.3),
    ([30.0, 6.8, 21.5], 7.5, 3.6),
    ([29.6, 6.7, 21.0], 5.7, 2.9),
];
/// Element sizes along the plates of [`MeshOptions::graded`].
const FACTORS: [f64; 3] = [1.8, 1.6, 1.4];
const DRIVE_MM: f64 = 7.0;
const NOISE_SD_MM: f64 = 0.05;

/// Information of the displacements of one scan about ln α.
fn information(specimen: &Specimen, mesh: &MeshOptions) -> Result<(f64, usize), Box<dyn std::error::Error>> {
    let (bulk_kpa, mu_kpa, alpha) = (2173.0, 17.0, 1.91);
    let material = Material::new(bulk_kpa, [(mu_kpa, alpha)])?;
    let scan = ScanSettings {
        voxel_mm: [1.0, 0.1875, 0.75],
        noise_sd_mm: [NOISE_SD_MM; 3],
        force_sd_n: 0.02,
        ..ScanSettings::default()
    };
    let mut model = ForwardModel::of_specimen(specimen, mesh)?;
    let scanner = Scanner::new(specimen, model.mesh(), &scan, Sampling::default())?;
    let path = model.solve_path(&material, &[DRIVE_MM], &SolveOptions::default(), &|| false)?;
    let sensitivities = model.tangent(&material, &path[0])?.material_sensitivities()?;
    // κ, μ, α.
    let voxels = scanner.operator.average(&sensitivities[2].displacement)?;
    let squares: f64 = voxels.iter().flatten().map(|s| s * s).sum();
    Ok((squares * (alpha / NOISE_SD_MM).powi(2), model.mesh().num_elements()))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let published = Specimen::from_json(include_str!("../geometries/two-hole-shear.json"))?;
    println!(
        "Information about ln alpha over the first block's, without | with a layer along free faces, sizes {FACTORS:?}"
    );
    let mut of_first = [[f64::NAN; FACTORS.len()]; 2];
    for (block, (extents_mm, place_mm, diameter_mm)) in BLOCKS.into_iter().enumerate() {
        let mut specimen = published.clone();
        let size = &mut specimen.block;
        [size.length_mm, size.thickness_mm, size.width_mm] = extents_mm;
        for (hole, side) in specimen.holes.iter_mut().zip([-1.0, 1.0]) {
            (hole.center_mm[0], hole.diameter_mm) = (side * place_mm, diameter_mm);
        }
        print!("{extents_mm:?} mm, holes of {diameter_mm} mm at +-{place_mm} mm:");
        for (kind, of_first) in of_first.iter_mut().enumerate() {
            for (factor, of_first) in FACTORS.into_iter().zip(of_first) {
                let graded = MeshOptions::graded(&specimen, factor);
                let free_layer_mm = if kind == 0 { 0.0 } else { graded.free_layer_mm };
                let (found, _) = information(&specimen, &MeshOptions { free_layer_mm, ..graded })?;
                if block == 0 {
                    *of_first = found;
                }
                print!("  {:.3}", found / *of_first);
            }
            print!("{}", if kind == 0 { "  |" } else { "\n" });
        }
    }
    println!("\nsize  layers  grading  elements  information of the displacements about ln alpha");
    for (factor, levels, grading) in MESHES {
        let mesh = MeshOptions { levels, grading, ..MeshOptions::scaled(&published, factor) };
        match information(&published, &mesh) {
            Ok((found, elements)) => println!("{factor:<5} {levels:>6}  {grading:>7}  {elements:>8}  {found:.0}"),
            Err(error) => println!("{factor:<5} {levels:>6}  {grading:>7}            {error}"),
        }
    }
    Ok(())
}
