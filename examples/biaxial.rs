//! A material from a biaxial test: two stretches that are prescribed independently, and both nominal stresses.
//!
//! ```text
//! cargo run --release --example biaxial
//! ```

use lambdak::homogeneous::{CsvOptions, Curve, CurveFitOptions, fit_curves, read_biaxial_csv};

/// A silicone membrane of which the second axis is strained half as much as the first.
const TABLE: &str = "\
strain x [%];strain y [%];P11 [kPa];P22 [kPa]
0;0;0;0
5;2.5;4.95;3.88
10;5;8.95;7.24
15;7.5;12.44;10.03
20;10;15.39;12.52
25;12.5;17.98;14.67
30;15;20.31;16.58
40;20;24.21;19.80
50;25;27.46;22.23
60;30;30.29;24.49
";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let test = read_biaxial_csv(TABLE, &CsvOptions::default())?;
    let stresses = test.stresses.each_ref().map(Option::as_deref);
    let curves = Curve::biaxial("membrane", &test.drives, stresses)?;
    let options = CurveFitOptions { max_terms: 1, ..CurveFitOptions::default() };
    let sequence = fit_curves(&curves, &options)?;
    let fit = sequence.chosen();
    for parameter in &fit.parameters {
        println!("{:<8} {:>8.4} ± {:.4}", parameter.name, parameter.value, parameter.sd.unwrap_or(f64::NAN));
    }
    for curve in &fit.curves {
        println!("{}: R² {:.5}, rms error {:.3} kPa", curve.name, curve.r_squared, curve.rms_error_kpa);
    }
    Ok(())
}
