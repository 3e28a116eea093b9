//! How well a bar's exponent comes out, over the diameter of the hole in it: a loop and a plot.
//!
//! ```text
//! cargo run --release --example diameter      # writes diameter.svg
//! ```

use lambdak::prelude::*;
use lambdak::report::{Line, LinePlot};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut specimen = Specimen::from_json(include_str!("../geometries/uniaxial-bar.json"))?;
    let material = Material::new(2173.0, [(17.0, 1.91)])?;
    let scan = ScanSettings { voxel_mm: [1.0, 0.5, 1.0], ..ScanSettings::default() };
    let drives = DriveSelection::DriveMm(vec![8.0]);
    let mut points = Vec::new();
    for diameter_mm in [2.0, 3.0, 4.0, 5.0, 6.0] {
        specimen.holes[0].diameter_mm = diameter_mm;
        specimen.validate()?;
        let options =
            EvaluationOptions { mesh: MeshOptions::search(&specimen), ..EvaluationOptions::standard(&specimen) };
        let (evaluation, _) = evaluate(&specimen, &material, &scan, &drives, &options, &|| false)?;
        // Parameters come in the order of `Material::parameters`: κ, μ₁, α₁.
        let alpha = &evaluation.promised_sd[2];
        let percent = alpha.relative_sd.map_or(f64::NAN, |sd| 100.0 * sd);
        println!("{diameter_mm} mm: {} known to {percent:.2} %", alpha.parameter);
        points.push([diameter_mm, percent]);
    }
    let plot = LinePlot {
        title: "What one scan tells about alpha".into(),
        x_label: "diameter of the hole, mm".into(),
        y_label: "promised standard deviation, %".into(),
        is_log: false,
        lines: vec![Line { name: String::new(), points, has_marks: true, ..Line::default() }],
    };
    std::fs::write("diameter.svg", plot.to_svg())?;
    Ok(())
}
