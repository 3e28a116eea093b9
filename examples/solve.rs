//! Forces of a specimen at its drives.
//!
//! ```text
//! cargo run --release --example solve
//! ```

use lambdak::prelude::*;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let specimen = Specimen::from_json(include_str!("../geometries/two-hole-shear.json"))?;
    let material = Material::new(2173.0, [(17.0, 1.91)])?;
    let mut model = ForwardModel::of_specimen(&specimen, &MeshOptions::search(&specimen))?;
    let path = model.solve_path(&material, &specimen.drive_mm, &SolveOptions::default(), &|| false)?;
    for state in path {
        println!("{} mm: {:.3} N", state.drive_mm, state.force_n);
    }
    Ok(())
}
