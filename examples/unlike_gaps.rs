//! What one scan would promise of blocks whose thickness varies, between plates that follow it: wedges and steps,
//! along the drive and across it. The table is in docs/design-study.md.
//!
//! All blocks hold the volume of the published one, and are driven until the thinnest place of each is sheared as much
//! as the published block is at 7 mm. Of these only a wedge along the drive has a file and a mesh of its own (`wedge_mm`
//! of a block): the mesh of a block of even thickness is stretched between the plates, and so are the voxels, which count
//! by the material in them.
//!
//! ```text
//! cargo run --release --example unlike_gaps
//! ```

use lambdak::fem::{ForwardModel, SolveOptions};
use lambdak::mesh::{MeshOptions, mesh_specimen};
use lambdak::prelude::*;
use lambdak::sensitivity::{FisherInformation, MeasurementNoise};
use lambdak::voxel::{Sampling, VoxelGrid, VoxelMask, VoxelOperator};
use std::error::Error;

/// Drive of the block of even thickness, mm.
const DRIVE_MM: f64 = 7.0;
/// Largest departure of the thickness from its mean, relative to that.
const DEPARTURES: [f64; 2] = [0.15, 0.3];
/// Half the length of the ramp of a step, as a part of half the block's extent.
const HALF_RAMP: f64 = 0.15;
/// Element size as a factor on the standard one.
const MESH_FACTOR: f64 = 1.4;

/// How the thickness goes from thin to thick, from −1 at one end (ξ = −1) to 1 at the other (ξ = 1).
type Shape = fn(f64) -> f64;

const SHAPES: [(&str, Shape, usize); 4] = [
    ("wedge along the drive", |xi| xi, 0),
    ("wedge across it", |xi| xi, 2),
    ("step along the drive", |xi| (xi / HALF_RAMP).clamp(-1.0, 1.0), 0),
    ("step across it", |xi| (xi / HALF_RAMP).clamp(-1.0, 1.0), 2),
];

/// Relative standard deviations that one scan of one block and the force of two promise: μ₁, α₁, and so on. `ratio` is
/// the thickness at a place (x, y, z) over its mean.
fn promised(
    specimen: &Specimen,
    material: &Material,
    drive_mm: f64,
    ratio: impl Fn([f64; 3]) -> f64,
) -> Result<Vec<f64>, Box<dyn Error>> {
    let options = MeshOptions { use_mirror: false, ..MeshOptions::graded(specimen, MESH_FACTOR) };
    let mut mesh = mesh_specimen(specimen, &options)?;
    let mask = VoxelMask::of_specimen(specimen, VoxelGrid::covering(specimen, [1.0, 0.1875, 0.75])?)?;
    let operator = VoxelOperator::new(specimen, &mesh, &mask, Sampling::default())?;
    let weights: Vec<f64> = mask.voxels.iter().map(|&voxel| ratio(mask.grid.center_mm(voxel as usize))).collect();
    for node in &mut mesh.nodes {
        node[1] *= ratio(*node);
    }
    let mut model = ForwardModel::new(mesh, specimen)?;
    let path = model.solve_path(material, &[drive_mm], &SolveOptions::default(), &|| false)?;
    let sensitivities = model.tangent(material, &path[0])?.material_sensitivities()?;
    let voxels = sensitivities.iter().map(|s| operator.average(&s.displacement)).collect::<Result<Vec<_>, _>>()?;
    let forces: Vec<f64> = sensitivities.iter().map(|s| s.force_n).collect();
    let noise = MeasurementNoise { displacement_sd_mm: [0.05; 3], force_sd_n: 0.02 };
    let information = FisherInformation::of_drive(material, &voxels, &weights, &forces, &noise)?;
    let covariance = information.covariance();
    // The first parameter is κ.
    Ok((1..forces.len()).map(|p| covariance.relative_sd(p).unwrap_or(f64::NAN)).collect())
}

fn main() -> Result<(), Box<dyn Error>> {
    let published = Specimen::from_json(include_str!("../geometries/two-hole-shear.json"))?;
    let solid = Specimen { holes: Vec::new(), ..published.clone() };
    let one = Material::from_json(include_str!("../geometries/materials/ecoflex-0020.json"))?;
    let two = Material::from_json(include_str!("../geometries/materials/ecoflex-0020-two-term.json"))?;
    println!("Times better than the block of even thickness: mu_1, alpha_1 | mu_1, alpha_1, mu_2, alpha_2");
    for (name, specimen) in [("two holes", published), ("solid", solid)] {
        let even = [&one, &two].map(|material| promised(&specimen, material, DRIVE_MM, |_| 1.0));
        let even = even.into_iter().collect::<Result<Vec<_>, _>>()?;
        println!("{name}, even, at {DRIVE_MM} mm, promised per cent: {}", line(&even, |sd, _| 100.0 * sd));
        let extents_mm = [specimen.block.length_mm, specimen.block.thickness_mm, specimen.block.width_mm];
        for (shape_name, shape, axis) in SHAPES {
            for departure in DEPARTURES {
                let ratio = |place: [f64; 3]| 1.0 + departure * shape(2.0 * place[axis] / extents_mm[axis]);
                let drive_mm = DRIVE_MM * (1.0 - departure);
                let found = [&one, &two].map(|material| promised(&specimen, material, drive_mm, ratio));
                let found = found.into_iter().collect::<Result<Vec<_>, _>>()?;
                let gain = |sd: f64, [material, parameter]: [usize; 2]| even[material][parameter] / sd;
                println!("  {shape_name}, +-{:.0} %, at {drive_mm:.2} mm: {}", 100.0 * departure, line(&found, gain));
            }
        }
    }
    Ok(())
}

/// `figure` of each standard deviation of each material, whose indices it is given.
fn line(found: &[Vec<f64>], figure: impl Fn(f64, [usize; 2]) -> f64) -> String {
    let of_material = |(material, sds): (usize, &Vec<f64>)| {
        let figures = sds.iter().enumerate().map(|(p, sd)| format!("{:.2}", figure(*sd, [material, p])));
        figures.collect::<Vec<_>>().join(", ")
    };
    found.iter().enumerate().map(of_material).collect::<Vec<_>>().join(" | ")
}
