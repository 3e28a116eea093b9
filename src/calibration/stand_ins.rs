//! Synthetic stand-ins of the published experiments: two-hole specimens at 2.5 and 5 mm, raw and filtered, each fitted
//! with one, two and three terms by the paper's objective.

use super::calibrate::calibrate;
use super::calibrate_options::{CalibrateOptions, TermCount};
use super::contours::{Contour, ContourOptions, contours};
use super::error::CalibrationError;
use super::observed::Observed;
use super::outcome::Calibration;
use super::problem::CalibrationProblem;
use super::synthetic::SyntheticScan;
use super::target::{Objective, PAPER_BETA};
use crate::fem::SolveOptions;
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::recording::Filter;
use crate::sensitivity::{Protocol, ScanSettings};
use crate::specimen::Specimen;

/// Drives of the published fits, mm.
pub const STAND_IN_DRIVES_MM: [f64; 2] = [2.5, 5.0];

/// Settings of [`stand_ins`].
#[derive(Clone, Copy, Debug)]
pub struct StandInOptions {
    /// Element size of the truth relative to standard.
    pub truth_factor: f64,
    /// Element size of the fits relative to standard.
    pub fit_factor: f64,
    /// Voxels and noise.
    pub scan: ScanSettings,
    /// Seed of the noise.
    pub seed: u64,
    /// What is minimised.
    pub objective: Objective,
}

impl Default for StandInOptions {
    /// The paper's scan and objective, on elements of 1.4 times the standard size with a truth on finer ones.
    fn default() -> Self {
        StandInOptions {
            truth_factor: 0.75 * 1.4,
            fit_factor: 1.4,
            scan: ScanSettings::default(),
            seed: 1,
            objective: Objective::Paper { beta: PAPER_BETA },
        }
    }
}

/// One stand-in.
#[derive(Debug)]
pub struct StandIn {
    /// Drive, mm.
    pub drive_mm: f64,
    /// Raw or filtered.
    pub filter: Filter,
    /// Fits with one to three terms in its selection; the estimate is the one-term fit's successor by the rules.
    pub calibration: Calibration,
}

/// The four stand-ins, and contours at 2.5 mm, filtered, around the one-term fit at 5 mm, filtered.
///
/// # Errors
/// [`CalibrationError`].
pub fn stand_ins(
    specimen: &Specimen,
    truth: &Material,
    options: &StandInOptions,
    on_stage: &dyn Fn(&str),
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<(Vec<StandIn>, Vec<Contour>), CalibrationError> {
    let solve = SolveOptions::trial();
    let truth_mesh = MeshOptions { grading: 0.4, ..MeshOptions::scaled(specimen, options.truth_factor) };
    let mut all = Vec::new();
    let mut small = None;
    for filter in [Filter::None, Filter::Hamming2] {
        for drive in STAND_IN_DRIVES_MM {
            on_stage(&format!("{drive} mm, {filter:?}"));
            let driven = Specimen { drive_mm: vec![drive], ..specimen.clone() };
            let (scan, plain) = (&options.scan, Protocol::default());
            let synthetic = SyntheticScan::new(&driven, truth, scan, &plain, &truth_mesh, &solve, is_cancelled)?;
            let recording =
                synthetic.recording("stand-in", &driven, &synthetic.draw(options.seed, drive.to_bits()), filter)?;
            let observed = [Observed::new(&recording, options.scan.force_sd_n)?];
            let settings = CalibrateOptions {
                terms: TermCount::Fixed(3),
                objective: options.objective,
                mesh_factor: options.fit_factor,
                has_mesh_allowance: false,
                num_starts: 2,
                ..CalibrateOptions::default()
            };
            let mesh = |s: &Specimen, factor: f64| MeshOptions::scaled(s, factor);
            let calibration = calibrate(&observed, &mesh, &settings, on_stage, is_cancelled)?;
            if filter == Filter::Hamming2 && small.is_none() {
                small = Some(observed);
            }
            all.push(StandIn { drive_mm: drive, filter, calibration });
        }
    }
    let mut around = Vec::new();
    if let (Some(observed), Some(trained)) = (&small, all.last()) {
        on_stage("contours");
        // Of the one-term fit: κ, μ₁, α₁.
        let values = trained.calibration.selection.rows.first().map(|r| r.values.clone()).unwrap_or_default();
        if let [bulk_kpa, mu_kpa, alpha] = values[..] {
            let terms = vec![crate::material::OgdenTerm { mu_kpa, alpha }];
            let material = Material { bulk_kpa, terms, law: None };
            let mesh = |s: &Specimen| MeshOptions::scaled(s, options.fit_factor);
            let problem = CalibrationProblem::new(observed, &mesh, options.objective)?;
            let fit = problem.at(&material, is_cancelled)?;
            let beta = if let Objective::Paper { beta } = options.objective { beta } else { PAPER_BETA };
            around = contours(&problem, &fit, &ContourOptions { beta, ..ContourOptions::default() }, is_cancelled)?;
        }
    }
    Ok((all, around))
}
