//! Calibrate: the material from recordings, with its uncertainty and the number of terms.

use super::array_files::add_arrays;
use super::input_use::{InputForm, InputUse};
use super::request::RecordingOutline;
use super::subject::check_mesh;
use super::{Context, JobError, Outcome, Progress, Request, ResultSchema, Run, cost, defaults, summary};
use crate::calibration::{
    Boundary, CalibrateOptions, Calibration, CalibrationResult, ContourOptions, DECREMENT_THRESHOLD, Objective,
    Observed, PAPER_BETA, Rule, TermCount, calibrate,
};
use crate::export::{ArrayFormat, calibration_arrays};
use crate::field::FieldError;
use crate::material::LawKind;
use crate::mesh::{MeshOptions, MeshSize};
use crate::recording::write_vectors;
use crate::report::calibration_report;
use crate::sensitivity::Protocol;
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What is minimised.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ObjectiveName {
    /// χ² by the noise.
    #[default]
    Weighted,
    /// The paper's loss.
    Paper,
}

/// Body of a calibration.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CalibrationRequest {
    /// Recordings (mru-recording/1); all are fitted together.
    #[schema(min_items = 1, max_items = 20)]
    pub recordings: Vec<String>,
    /// Number of Ogden terms; chosen by the rule where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 5)]
    pub num_terms: Option<usize>,
    /// A law in the first invariant in the place of Ogden's terms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<LawKind>,
    /// Rule that decides the number of terms.
    #[serde(default)]
    #[schema(default = Rule::default)]
    pub rule: Rule,
    /// Smallest decrement of the paper's loss that keeps a term.
    #[serde(default = "decrement")]
    #[schema(minimum = 0.0, maximum = 1e12, default = decrement)]
    pub decrement: f64,
    /// What is minimised: chi-square by the noise, or the paper's loss.
    #[serde(default)]
    #[schema(default = ObjectiveName::default)]
    pub objective: ObjectiveName,
    /// Weight of the force in the paper's loss.
    #[serde(default = "beta")]
    #[schema(minimum = 0.0, maximum = 1e12, default = beta)]
    pub beta: f64,
    /// Element size as a factor on the standard one.
    #[serde(default = "mesh_factor")]
    #[schema(minimum = 0.2, maximum = 5.0, default = mesh_factor)]
    pub mesh_factor: f64,
    /// Whether a second mesh widens the intervals by the error of the first.
    #[serde(default = "defaults::yes")]
    #[schema(default = defaults::yes)]
    pub has_mesh_allowance: bool,
    /// Starts tried for every number of terms.
    #[serde(default = "num_starts")]
    #[schema(minimum = 1, maximum = 20, default = num_starts)]
    pub num_starts: usize,
    /// Voxels nearer than this to the ends of a sheared block are left out, mm.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 1000.0, default = 0.0)]
    pub end_margin_mm: f64,
    /// What moves the boundary of the model: the plates as commanded, or the displacement measured on two planes inside
    /// the sample, between which alone it is then compared. The second needs no plates that moved as they were told.
    #[serde(default)]
    #[schema(default = Boundary::default)]
    pub boundary: Boundary,
    /// Forces read on the way to the scans, from recordings' load curves, and what is unknown of the load cell. Gain
    /// and zero of the cell are estimated beside the material; the drive's zero is taken to be known.
    #[serde(default)]
    pub protocol: Protocol,
    /// Profile likelihoods of all parameters.
    #[serde(default)]
    pub has_profiles: bool,
    /// Contours of the losses around the estimate.
    #[serde(default)]
    pub has_contours: bool,
    /// Further files with parameters, covariance and what was compared, voxel by voxel: arrays for MATLAB and Python.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 2)]
    pub arrays: Vec<ArrayFormat>,
}

fn decrement() -> f64 {
    DECREMENT_THRESHOLD
}

fn beta() -> f64 {
    PAPER_BETA
}

fn mesh_factor() -> f64 {
    CalibrateOptions::default().mesh_factor
}

fn num_starts() -> usize {
    CalibrateOptions::default().num_starts
}

impl CalibrationRequest {
    fn options(&self) -> CalibrateOptions {
        let default = CalibrateOptions::default();
        CalibrateOptions {
            terms: self.num_terms.map_or(default.terms, TermCount::Fixed),
            law: self.law,
            objective: match self.objective {
                ObjectiveName::Weighted => Objective::Weighted,
                ObjectiveName::Paper => Objective::Paper { beta: self.beta },
            },
            rule: self.rule,
            decrement_threshold: self.decrement,
            mesh_factor: self.mesh_factor,
            has_mesh_allowance: self.has_mesh_allowance,
            num_starts: self.num_starts,
            has_profiles: self.has_profiles,
            contours: self.has_contours.then(|| ContourOptions { beta: self.beta, ..ContourOptions::default() }),
            ..default
        }
    }

    /// The recordings as they are compared, and their names.
    fn observed(&self, context: &Context) -> Result<(Vec<Observed>, Vec<String>), JobError> {
        let (mut observed, mut names) = (Vec::new(), Vec::new());
        for (index, read) in context.recordings.iter().enumerate() {
            let recording = &read.recording;
            let unfit = |e: &dyn std::fmt::Display| {
                let error = FieldError::new(format!("/recordings/{index}"), &recording.id, "fit for a calibration");
                JobError::from(error.remedy(e.to_string()))
            };
            let mut ready = Observed::new(recording, defaults::force_sd_n()).map_err(|e| unfit(&e))?;
            if self.end_margin_mm > 0.0 && ready.leave_out_ends(self.end_margin_mm) == 0 {
                let allowed = "small enough to leave a voxel";
                return Err(JobError::at("/end_margin_mm", self.end_margin_mm, allowed));
            }
            let ready =
                ready.with_protocol(recording, &self.protocol, defaults::force_sd_n()).map_err(|e| unfit(&e))?;
            let parts = ready.with_boundary(self.boundary).map_err(|e| unfit(&e))?.steps_apart();
            for part in &parts {
                names.push(match (&part.steps[..], parts.len()) {
                    ([step], 2..) => format!("{} at {} mm", recording.id, step.drive_mm),
                    _ => recording.id.clone(),
                });
            }
            observed.extend(parts);
        }
        Ok((observed, names))
    }
}

impl Request for CalibrationRequest {
    const COMMAND: &'static str = "calibrate";
    const COLLECTION: &'static str = "calibrations";
    const ABOUT: &'static str = "The material, from recordings of a specimen, with its uncertainty.";

    fn example() -> serde_json::Value {
        serde_json::json!({ "recordings": [super::defaults::EXAMPLE_RECORDING], "num_terms": 1, "mesh_factor": 2.0 })
    }

    fn result() -> ResultSchema {
        ResultSchema::of::<CalibrationResult>("calibration/1")
    }

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        let mut errors: Vec<FieldError> =
            self.protocol.field_errors().into_iter().map(|e| e.below("/protocol")).collect();
        let of_plates = [
            ("/protocol/drive_zero_sd_mm", self.protocol.drive_zero_sd_mm),
            ("/protocol/plate_tilt_sd_deg", self.protocol.plate_tilt_sd_deg),
        ];
        for (pointer, sd) in of_plates.into_iter().filter(|(_, sd)| *sd > 0.0) {
            let error = FieldError::new(pointer, sd, "0");
            errors.push(error.remedy("a calibration takes the plates as recorded; `diagnose` finds where they were"));
        }
        if self.protocol.blocks_scanned != 1 {
            let error = FieldError::new("/protocol/blocks_scanned", self.protocol.blocks_scanned, "1");
            errors.push(error.remedy("a recording is of one block; give one recording for each that was scanned"));
        }
        if !self.protocol.scan_share.is_empty() {
            let error = FieldError::new("/protocol/scan_share", "given", "left out");
            errors.push(error.remedy("a recording states the noise that its scans had"));
        }
        if let (Some(_), Some(count)) = (self.law, self.num_terms) {
            let error = FieldError::new("/num_terms", count, "left out where a law is given");
            errors.push(error.remedy("a law in the first invariant has no Ogden terms; leave out one of the two"));
        }
        if self.boundary == Boundary::Measured
            && let Some(drive_mm) = self.protocol.force_drive_mm.first()
        {
            let error = FieldError::new("/protocol/force_drive_mm", *drive_mm, "left out");
            errors.push(error.remedy("where nothing was scanned, nothing was measured at the boundary"));
        }
        if errors.is_empty() { Ok(Box::new(self)) } else { Err(errors) }
    }
}

impl Run for CalibrationRequest {
    fn title(&self) -> String {
        match &self.recordings[..] {
            [one] => format!("calibration on {one}"),
            several => format!("calibration on {} recordings", several.len()),
        }
    }

    fn inputs(&self) -> Vec<InputUse> {
        InputUse::of_list("/recordings", &self.recordings, InputForm::Displacements)
    }

    fn takes_surfaces(&self) -> bool {
        true
    }

    fn check_size(&self, recordings: &[RecordingOutline], max_elements: usize) -> Result<(), FieldError> {
        let mesh = MeshSize::Factor(self.mesh_factor);
        recordings.iter().try_for_each(|r| check_mesh(&r.specimen, mesh, "/mesh_factor", max_elements))
    }

    fn estimated_seconds(&self, recordings: &[RecordingOutline]) -> Option<f64> {
        let effort = cost::CalibrationEffort {
            num_terms: self.num_terms,
            num_starts: self.num_starts,
            has_profiles: self.has_profiles,
            has_contours: self.has_contours,
        };
        cost::of_calibration(recordings, self.mesh_factor, effort)
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        let options = self.options();
        let (observed, names) = self.observed(context)?;
        let on_stage = |text: &str| context.progress(&Progress::stage(text));
        let mesh = |s: &Specimen, factor: f64| MeshOptions::scaled(s, factor);
        let found = calibrate(&observed, &mesh, &options, &on_stage, &|| context.is_cancelled())
            .map_err(|e| context.failed(&e))?;
        let result = CalibrationResult::new(&found, &observed, &names, options.objective, context.input_hash.clone());
        let mut outcome = Outcome::new("calibration.json", &result, summary::calibration(&result))?;
        add_fields(&mut outcome, &found, &observed)?;
        let (pictures, report) = calibration_report(&found, &result, &observed);
        outcome.add_pictures(pictures);
        outcome.add("report.html", report.to_html());
        outcome.add("material.json", result.material.to_json());
        if !self.arrays.is_empty() {
            let tree = calibration_arrays(&found, &observed, &names);
            add_arrays(&mut outcome, "calibration", tree, &self.arrays, context)?;
        }
        Ok(outcome)
    }
}

/// Per recording and drive what was measured, what the material predicts, and the rest, as images.
fn add_fields(outcome: &mut Outcome, found: &Calibration, observed: &[Observed]) -> Result<(), JobError> {
    for (r, recording) in observed.iter().enumerate() {
        for (s, step) in recording.steps.iter().enumerate() {
            let model = found.fit.predicted(r, s);
            let rest = found.fit.misfit(r, s, &step.displacement);
            let grid = &recording.mask.grid;
            let images =
                [("measured", &step.displacement[..], false), ("model", model, true), ("misfit", &rest[..], false)];
            for (what, values, knows_all) in images {
                let name = format!("{what}_{}_{}.nii.gz", r + 1, s + 1);
                let mut spread = recording.mask.spread(values, [f64::NAN; 3]);
                if !knows_all {
                    grid.fill_unmeasured(&mut spread, f64::NAN);
                }
                outcome.add_written(false, |folder| write_vectors(folder, &name, grid, &spread))?;
            }
        }
    }
    Ok(())
}
