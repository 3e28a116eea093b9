//! A material from arrays: displacements on a grid of voxels, and the force, as any program may hold them.
//!
//! ```text
//! cargo run --release --example calibrate
//! ```

use lambdak::prelude::*;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut specimen = Specimen::from_json(include_str!("../geometries/solid-shear.json"))?;
    specimen.drive_mm = vec![4.0];

    // These arrays stand for measured ones: voxel after voxel, x fastest, in the frame of the specimen's centre.
    let grid = VoxelGrid::covering(&specimen, [2.0, 0.8, 2.0])?;
    let (displacement, force_n) = measured(&specimen, &grid)?;

    let recording = Recording {
        id: "arrays".into(),
        specimen: specimen.clone(),
        mask: vec![true; grid.num_voxels()],
        grid,
        steps: vec![RecordedStep {
            drive_mm: 4.0,
            force_n: Some(force_n),
            force_sd_n: Some(0.02),
            window_s: None,
            displacement,
        }],
        noise_sd_mm: Some([0.02; 3]),
        filter: Filter::None,
        load: None,
        notes: None,
    };
    let observed = Observed::new(&recording, 0.02)?;
    let options = CalibrateOptions {
        terms: TermCount::Fixed(1),
        mesh_factor: 2.0,
        has_mesh_allowance: false,
        num_starts: 1,
        ..CalibrateOptions::default()
    };
    let found = calibrate(&[observed], &MeshOptions::scaled, &options, &|_| {}, &|| false)?;
    for estimate in &found.estimates {
        match estimate.sd.filter(|_| estimate.is_identifiable) {
            Some(sd) => println!("{} = {:.3} ± {sd:.3}", estimate.parameter.name(), estimate.value),
            None => println!("{} is not identifiable", estimate.parameter.name()),
        }
    }
    Ok(())
}

/// Displacements in mm and a force in N.
type Measured = (Vec<[f64; 3]>, f64);

/// What a scan would see of a known material, with a wave in place of noise, and the force.
fn measured(specimen: &Specimen, grid: &VoxelGrid) -> Result<Measured, Box<dyn std::error::Error>> {
    let truth = Material::new(2173.0, [(17.0, 1.91)])?;
    let mut model = ForwardModel::of_specimen(specimen, &MeshOptions::search(specimen))?;
    let state = model.solve(&truth, specimen.drive_mm[0], None, &SolveOptions::default(), &|| false)?;
    let mask = VoxelMask::of_specimen(specimen, grid.clone())?;
    let seen = VoxelOperator::new(specimen, model.mesh(), &mask, Sampling::default())?.average(&state.displacement)?;
    let wave = |v: usize, c: usize| 0.02 * (1.7 * v as f64 + 2.9 * c as f64).sin();
    let noisy: Vec<[f64; 3]> = seen.iter().enumerate().map(|(v, u)| [0, 1, 2].map(|c| u[c] + wave(v, c))).collect();
    Ok((mask.spread(&noisy, [f64::NAN; 3]), state.force_n))
}
