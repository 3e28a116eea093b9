//! Paper tables: tables like the paper's on synthetic stand-ins of its experiments.

use super::{Context, JobError, Outcome, Progress, Request, ResultSchema, Run, defaults, summary};
use crate::calibration::{Contour, Objective, PAPER_BETA, StandInOptions, TermSelection, stand_ins};
use crate::field::FieldError;
use crate::field::schema::Seed;
use crate::homogeneous::{UniaxialStandIn, UniaxialStandInOptions, uniaxial_stand_in};
use crate::recording::Filter;
use crate::report::{ContourPlot, contour_panels};
use crate::sensitivity::ScanSettings;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Element size of the truth relative to that of the fits.
const TRUTH_OVER_FIT: f64 = 0.75;

/// Body of the paper's tables.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PaperTablesRequest {
    /// Noise of the raw displacement in mm, one standard deviation.
    #[serde(default = "noise_sd_mm")]
    #[schema(min_items = 3, max_items = 3, default = noise_sd_mm)]
    pub noise_sd_mm: [f64; 3],
    /// Noise of the load cell in N, one standard deviation.
    #[serde(default = "defaults::force_sd_n")]
    #[schema(minimum = 1e-9, maximum = 1e9, default = defaults::force_sd_n)]
    pub force_sd_n: f64,
    /// Noise of the dumb-bell's load cell relative to its largest force, one standard deviation.
    #[serde(default = "dumbbell_noise")]
    #[schema(minimum = 0.0, maximum = 0.5, default = dumbbell_noise)]
    pub dumbbell_noise: f64,
    /// Element size of the fits as a factor on the standard one.
    #[serde(default = "mesh_factor")]
    #[schema(minimum = 0.2, maximum = 5.0, default = mesh_factor)]
    pub mesh_factor: f64,
    /// Seed of the noise.
    #[serde(default = "seed")]
    #[schema(value_type = Seed, default = seed)]
    pub seed: u64,
    /// Weight of the force in the loss.
    #[serde(default = "beta")]
    #[schema(minimum = 0.0, maximum = 1e12, default = beta)]
    pub beta: f64,
}

fn noise_sd_mm() -> [f64; 3] {
    defaults::scan().noise_sd_mm
}

fn dumbbell_noise() -> f64 {
    UniaxialStandInOptions::default().relative_noise
}

fn mesh_factor() -> f64 {
    StandInOptions::default().fit_factor
}

fn seed() -> u64 {
    StandInOptions::default().seed
}

fn beta() -> f64 {
    PAPER_BETA
}

/// Result (`paper-tables/1`).
#[derive(Serialize, ToSchema)]
struct PaperTablesResult<'a> {
    schema: &'static str,
    input_hash: &'a str,
    uniaxial: &'a UniaxialStandIn,
    /// The stand-ins of the recordings.
    stand_ins: Vec<StandInRow<'a>>,
    contours: &'a [Contour],
}

/// A row of the tables like the paper's 2 and 3.
#[derive(Serialize, ToSchema)]
#[schema(as = StandIn)]
struct StandInRow<'a> {
    drive_mm: f64,
    filter: Filter,
    /// The fits of each number of terms.
    term_selection: &'a TermSelection,
}

impl Request for PaperTablesRequest {
    const COMMAND: &'static str = "paper-tables";
    const COLLECTION: &'static str = "paper-tables";
    const ABOUT: &'static str = "Tables like the paper's on synthetic stand-ins of its experiments.";

    fn example() -> serde_json::Value {
        serde_json::json!({ "mesh_factor": 5.0 })
    }

    fn result() -> ResultSchema {
        ResultSchema::of::<PaperTablesResult>("paper-tables/1")
    }

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        let errors = self.scan().field_errors();
        if errors.is_empty() { Ok(Box::new(self)) } else { Err(errors) }
    }
}

impl PaperTablesRequest {
    fn scan(&self) -> ScanSettings {
        ScanSettings { noise_sd_mm: self.noise_sd_mm, force_sd_n: self.force_sd_n, ..defaults::scan() }
    }
}

impl Run for PaperTablesRequest {
    fn title(&self) -> String {
        "tables of the paper".into()
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        let options = StandInOptions {
            truth_factor: TRUTH_OVER_FIT * self.mesh_factor,
            fit_factor: self.mesh_factor,
            scan: self.scan(),
            seed: self.seed,
            objective: Objective::Paper { beta: self.beta },
        };
        let on_stage = |stage: &str| context.progress(&Progress::stage(stage));
        let cancelled = || context.is_cancelled();
        let (all, contours) =
            stand_ins(&defaults::two_hole_shear(), &defaults::ecoflex(), &options, &on_stage, &cancelled)
                .map_err(|e| context.failed(&e))?;
        on_stage("dumb-bell");
        let uniaxial = UniaxialStandInOptions {
            truth_factor: TRUTH_OVER_FIT * self.mesh_factor,
            fit_factor: self.mesh_factor,
            relative_noise: self.dumbbell_noise,
            seed: self.seed,
        };
        let uniaxial =
            uniaxial_stand_in(&defaults::dumbbell(), &uniaxial, &cancelled).map_err(|e| context.failed(&e))?;
        let rows = all.iter().map(|s| StandInRow {
            drive_mm: s.drive_mm,
            filter: s.filter,
            term_selection: &s.calibration.selection,
        });
        let result = PaperTablesResult {
            schema: "paper-tables/1",
            input_hash: &context.input_hash,
            uniaxial: &uniaxial,
            stand_ins: rows.collect(),
            contours: &contours,
        };
        let text = summary::paper_tables(&uniaxial, &all);
        let mut outcome = Outcome::new("paper-tables.json", &result, text)?;
        // The one-term fit stands in the middle of every axis.
        let middle = |name: &str| {
            let axis = |c: &Contour| c.parameters.iter().position(|p| p == name).map(|a| c.values[a].clone());
            contours.iter().find_map(axis).and_then(|values| values.get(values.len() / 2).copied())
        };
        outcome.add("contours.svg", ContourPlot { panels: contour_panels(&contours, &middle) }.to_svg());
        Ok(outcome)
    }
}
