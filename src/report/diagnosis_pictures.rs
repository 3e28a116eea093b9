//! The pictures of a diagnosis: what is left before and after, the evidence, the load curve, maps.

use super::bars::{BarGroup, GroupedBars};
use super::color::ColorMap;
use super::curves::{CurveSeries, CurvesPlot};
use super::lines::{Line, LinePlot};
use super::maps::{VoxelField, VoxelMaps};
use crate::diagnosis::{Diagnosis, LawCurve, LoadHistoryFit, ScoreMap, Trace, law_curves};
use crate::homogeneous::HomogeneousTest;

/// Most suspects in the picture of the evidence, and most letters of each label.
const MAX_SUSPECTS: usize = 12;

/// The pictures of a diagnosis as SVG.
pub(super) struct DiagnosisPictures {
    /// What the nominal model and the model with the causes leave at the largest drive.
    pub(super) residuals: [String; 2],
    /// What each suspect would explain.
    pub(super) evidence: String,
    /// The load curve, where there is one.
    pub(super) load_curve: Option<String>,
    /// The law with its correction, where it has one.
    pub(super) law: Option<String>,
    /// Maps of where a misfit may come from: name and picture.
    pub(super) maps: Vec<(String, String)>,
}

impl DiagnosisPictures {
    /// Draws all.
    pub(super) fn new(d: &Diagnosis) -> DiagnosisPictures {
        DiagnosisPictures {
            residuals: [
                residual_maps(d, &d.nominal.residual, "before"),
                residual_maps(d, &d.corrected.residual, "after"),
            ],
            evidence: evidence_bars(d),
            load_curve: d.load.as_ref().map(load_curve),
            law: law_plot(&law_curves(&d.corrected)),
            maps: d.maps.iter().map(|(name, map)| (name.clone(), significance_map(name, map))).collect(),
        }
    }

    /// File name without ending, and SVG, of each.
    fn into_files(self) -> Vec<(String, String)> {
        let [before, after] = self.residuals;
        let mut all = vec![
            ("residual-before".to_string(), before),
            ("residual-after".to_string(), after),
            ("evidence".to_string(), self.evidence),
        ];
        all.extend(self.load_curve.map(|svg| ("load-curve".to_string(), svg)));
        all.extend(self.law.map(|svg| ("law".to_string(), svg)));
        all.extend(self.maps.into_iter().enumerate().map(|(n, (_, svg))| (format!("map-{}", n + 1), svg)));
        all
    }
}

/// Pictures of a diagnosis: file name without ending, SVG.
pub fn diagnosis_pictures(d: &Diagnosis) -> Vec<(String, String)> {
    DiagnosisPictures::new(d).into_files()
}

fn load_curve(load: &LoadHistoryFit) -> String {
    let points = load.time_s.iter().zip(&load.measured_n).map(|(t, f)| [*t, *f]).collect();
    CurvesPlot {
        title: "The load curve: measured, with the effects found (full), without (dashed)".into(),
        x_label: "time (s)".into(),
        y_label: "force (N)".into(),
        series: vec![CurveSeries {
            name: "measured".into(),
            points,
            models: vec![load.force_n[1].clone(), load.force_n[0].clone()],
            ..CurveSeries::default()
        }],
    }
    .to_svg()
}

/// Stress over stretch of three tests, by the Ogden terms alone and with the correction.
fn law_plot(curves: &[LawCurve]) -> Option<String> {
    let lines_of = |curve: &LawCurve| {
        let test = match curve.test {
            HomogeneousTest::Uniaxial => "uniaxial",
            HomogeneousTest::PureShear => "pure shear",
            HomogeneousTest::Equibiaxial => "equibiaxial",
            HomogeneousTest::SimpleShear => "simple shear",
        };
        [("", 2), (", terms alone", 1)].map(|(which, column)| Line {
            name: format!("{test}{which}"),
            points: curve.points.iter().map(|p| [p[0], p[column]]).collect(),
            ..Line::default()
        })
    };
    let plot = LinePlot {
        title: "The law: Ogden terms and correction".into(),
        x_label: "stretch".into(),
        y_label: "nominal stress (kPa)".into(),
        is_log: false,
        lines: curves.iter().flat_map(lines_of).collect(),
    };
    (!curves.is_empty()).then(|| plot.to_svg())
}

/// Nineteen of twenty voxels are within the colours' range, which is no less than three standard deviations of the
/// noise.
const SHOWN_PART: f64 = 0.95;

/// The range of colours in which the pattern of some values can be seen.
fn visible_range(values: &[f64], noise_sd_mm: f64) -> f64 {
    let mut sizes: Vec<f64> = values.iter().map(|x| x.abs()).filter(|x| x.is_finite()).collect();
    sizes.sort_by(f64::total_cmp);
    let shown = (sizes.len() as f64 * SHOWN_PART) as usize;
    sizes.get(shown).copied().unwrap_or(0.0).max(3.0 * noise_sd_mm)
}

/// The residual at the last step, each component and each model on a scale of its own on which its pattern can be seen.
fn residual_maps(d: &Diagnosis, residual: &Trace, when: &str) -> String {
    let (mask, step) = (&d.observed.mask, d.observed.steps.len() - 1);
    let fields = (0..3)
        .map(|c| {
            let values: Vec<f64> = residual.displacement[step].iter().map(|u| u[c]).collect();
            let range = visible_range(&values, d.observed.noise_sd_mm[c]);
            VoxelField {
                title: format!("measured − model, u_{} ({when})", ["x", "y", "z"][c]),
                unit: "mm".into(),
                values: mask.spread(&values, f64::NAN),
                map: ColorMap::Diverging,
                range: Some([-range, range]),
            }
        })
        .collect();
    VoxelMaps { shape: mask.grid.shape, origin_mm: mask.grid.origin_mm, voxel_mm: mask.grid.voxel_mm, fields }.to_svg()
}

fn evidence_bars(d: &Diagnosis) -> String {
    let groups = d
        .ranked
        .iter()
        .filter(|r| r.round == 1)
        .take(MAX_SUSPECTS)
        .map(|r| BarGroup { label: r.description.clone(), values: vec![r.score, r.fitted.unwrap_or(f64::NAN)] })
        .collect();
    GroupedBars {
        title: "Causes by what they would explain".into(),
        axis_label: "fall of the deviance".into(),
        series: vec!["score test".into(), "full fit".into()],
        groups,
        is_log: true,
        reference: None,
        missing_label: "not fitted".into(),
    }
    .to_svg()
}

fn significance_map(name: &str, map: &ScoreMap) -> String {
    let counts = map.division.counts;
    let voxel = [0, 1, 2].map(|a| 2.0 * map.division.half_mm[a] / counts[a] as f64);
    VoxelMaps {
        shape: counts,
        origin_mm: [0, 1, 2].map(|a| -map.division.half_mm[a] + 0.5 * voxel[a]),
        voxel_mm: voxel,
        fields: vec![VoxelField {
            title: name.into(),
            unit: "σ".into(),
            values: map.significance.clone(),
            map: ColorMap::Diverging,
            range: None,
        }],
    }
    .to_svg()
}
