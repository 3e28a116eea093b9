//! The calibrated material as curves: stress over stretch in homogeneous tests, and the force over the drive.

use super::curves::{CurveSeries, CurvesPlot};
use super::lines::{Line, LinePlot};
use crate::calibration::{Calibration, Observed, TWO_SIDED_95};
use crate::homogeneous::{HomogeneousTest, respond};

/// Points of a stress curve.
const NUM_POINTS: usize = 41;

/// Nominal stress of the estimate over stretch, from rest to the largest stretch of the recordings, with what the noise
/// leaves uncertain where it is known.
pub(super) fn stress_picture(found: &Calibration) -> String {
    let fit = &found.fit;
    let tests =
        [(HomogeneousTest::Uniaxial, "uniaxial"), (HomogeneousTest::PureShear, "pure shear")].map(|(test, name)| {
            let mut line = Line { name: name.into(), ..Line::default() };
            for n in 0..NUM_POINTS {
                let stretch = 1.0 + (found.largest_stretch - 1.0) * n as f64 / (NUM_POINTS - 1) as f64;
                let Ok(response) = respond(&fit.material, &test.at(stretch)) else { continue };
                let stress = response.nominal_stress_kpa[0];
                // κ comes first and has no part in tests whose sides are free; it may not be known at all.
                let gradient: Vec<f64> = std::iter::once(0.0)
                    .chain(response.derivatives.iter().skip(1).map(|by_parameter| by_parameter[0]))
                    .collect();
                line.points.push([stretch, stress]);
                if let Some(sd) = fit.sd_along(&gradient) {
                    line.band.push([stress - TWO_SIDED_95 * sd, stress + TWO_SIDED_95 * sd]);
                }
            }
            line
        });
    LinePlot {
        title: "Stress over stretch".into(),
        x_label: "stretch".into(),
        y_label: "nominal stress, kPa".into(),
        is_log: false,
        lines: tests.into(),
    }
    .to_svg()
}

/// Forces measured and modelled over the drive, of every recording that has two of them.
pub(super) fn force_picture(found: &Calibration, observed: &[Observed], names: &[String]) -> Option<String> {
    let mut series = Vec::new();
    for (r, recording) in observed.iter().enumerate() {
        let scanned = recording.steps.iter().map(|step| (step.drive_mm, step.force));
        let on_the_way = recording.on_the_way.iter().map(|reading| (reading.drive_mm, Some(reading.force)));
        // The model's forces stand in this order, too.
        let mut forces: Vec<[f64; 3]> = scanned
            .chain(on_the_way)
            .enumerate()
            .filter_map(|(n, (drive, force))| Some([drive, force?.value_n, found.fit.force_n(r, n)]))
            .collect();
        forces.sort_by(|a, b| a[0].total_cmp(&b[0]));
        if forces.len() > 1 {
            series.push(CurveSeries {
                name: names.get(r).cloned().unwrap_or_default(),
                points: forces.iter().map(|f| [f[0], f[1]]).collect(),
                models: vec![forces.iter().map(|f| f[2]).collect()],
                ..CurveSeries::default()
            });
        }
    }
    let plot = CurvesPlot {
        title: "Force over drive: measured, and the model (line)".into(),
        x_label: "drive, mm".into(),
        y_label: "force, N".into(),
        series,
    };
    (!plot.series.is_empty()).then(|| plot.to_svg())
}
