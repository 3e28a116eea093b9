//! Diagnose: where recordings and their model differ, and what physics was left out.

use super::input_use::{InputForm, InputUse};
use super::request::RecordingOutline;
use super::subject::check_mesh;
use super::{Context, JobError, Outcome, Progress, Request, ResultSchema, Run, cost, summary};
use crate::calibration::Boundary;
use crate::diagnosis::{
    CauseName, Diagnosis, DiagnosisError, DiagnosisOptions, DiagnosisResult, TogetherResult, cause_names, diagnose,
    together,
};
use crate::field::FieldError;
use crate::material::Material;
use crate::mesh::MeshSize;
use crate::recording::write_vectors;
use crate::report::{diagnosis_pictures, diagnosis_report, together_pictures, together_report};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Body of a diagnosis: one `recording`, or several `recordings`, which are diagnosed one after the other and then
/// looked at together.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DiagnosisRequest {
    /// A recording (mru-recording/1).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recording: Option<String>,
    /// Several recordings in place of one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 20)]
    pub recordings: Vec<String>,
    /// The material as believed; its number of terms is the nominal one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<Material>,
    /// Element size as a factor on the standard one.
    #[serde(default = "mesh_factor")]
    #[schema(minimum = 0.3, maximum = 5.0, default = mesh_factor)]
    pub mesh_factor: f64,
    /// Displacement error that meshes may leave, mm rms at the largest drive; a thousandth of that drive where it is
    /// left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-9, maximum = 1000.0)]
    pub allowance_mm: Option<f64>,
    /// What moves the boundary of the model: the plates as commanded, or the displacement measured on two planes inside
    /// the sample, between which alone it is then compared. With the second no cause at the boundary is looked for.
    #[serde(default)]
    #[schema(default = Boundary::default)]
    pub boundary: Boundary,
    /// Most causes that the displacement is fitted with.
    #[serde(default = "max_causes")]
    #[schema(minimum = 1, maximum = 20, default = max_causes)]
    pub max_causes: usize,
    /// Causes that are not to be supposed (by the names that results give them), nor what contains them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 100)]
    pub without: Vec<String>,
}

fn mesh_factor() -> f64 {
    DiagnosisOptions::default().mesh_factor
}

fn max_causes() -> usize {
    DiagnosisOptions::default().max_causes
}

/// A diagnosis among several, for their result.
#[derive(Serialize, ToSchema)]
#[schema(as = DiagnosesResult)]
struct Several<'a> {
    schema: &'static str,
    input_hash: &'a str,
    diagnoses: Vec<&'a DiagnosisResult>,
    together: Option<&'a TogetherResult>,
}

/// The cause of a name.
fn known_cause(name: &str) -> Option<CauseName> {
    cause_names().into_iter().find(|c| c.as_str() == name)
}

impl DiagnosisRequest {
    fn options(&self) -> DiagnosisOptions {
        DiagnosisOptions {
            mesh_factor: self.mesh_factor,
            allowance_mm: self.allowance_mm,
            prior: self.material.clone(),
            max_causes: self.max_causes,
            boundary: self.boundary,
            left_out: self.without.iter().filter_map(|name| known_cause(name)).collect(),
            ..DiagnosisOptions::default()
        }
    }

    /// Diagnoses the recording of this index.
    fn diagnosed(&self, context: &Context, index: usize) -> Result<(Diagnosis, DiagnosisResult), JobError> {
        let recording = &context.recordings[index].recording;
        let progress = |text: &str| context.progress(&Progress::stage(text));
        let found = diagnose(recording, &self.options(), &progress, &|| context.is_cancelled())
            .map_err(|e| context.failed(&e))?;
        let result = DiagnosisResult::new(&found, &recording.id, context.input_hash.clone());
        Ok((found, result))
    }
}

impl Request for DiagnosisRequest {
    const COMMAND: &'static str = "diagnose";
    const COLLECTION: &'static str = "diagnoses";
    const ABOUT: &'static str = "Where recordings and their model differ, and what physics was left out.";

    fn example() -> serde_json::Value {
        serde_json::json!({ "recording": super::defaults::EXAMPLE_RECORDING, "material": super::defaults::ecoflex(), "max_causes": 3 })
    }

    fn result() -> ResultSchema {
        ResultSchema::of::<DiagnosisResult>("diagnosis/1").or(ResultSchema::of::<Several>("diagnoses/1"))
    }

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        let mut errors = Vec::new();
        if self.recording.is_some() != self.recordings.is_empty() {
            let error =
                FieldError::new("/recording", "neither alone nor left out", "given, or recordings in its place");
            errors.push(error.remedy("give one of the two"));
        }
        for error in self.material.iter().flat_map(Material::field_errors) {
            errors.push(error.below("/material"));
        }
        for (index, name) in self.without.iter().enumerate().filter(|(_, name)| known_cause(name).is_none()) {
            let known = cause_names().iter().map(|c| c.as_str()).collect::<Vec<_>>().join(", ");
            let allowed = format!("a cause that can be named: {known}");
            errors.push(FieldError::new(format!("/without/{index}"), format!("{name:?}"), allowed));
        }
        if errors.is_empty() { Ok(Box::new(self)) } else { Err(errors) }
    }
}

impl Run for DiagnosisRequest {
    fn title(&self) -> String {
        match &self.recording {
            Some(name) => format!("diagnosis of {name}"),
            None => format!("diagnosis of {} recordings", self.recordings.len()),
        }
    }

    fn inputs(&self) -> Vec<InputUse> {
        let form = InputForm::Displacements;
        match &self.recording {
            Some(name) => vec![InputUse { pointer: "/recording".into(), name: name.clone(), form }],
            None => InputUse::of_list("/recordings", &self.recordings, form),
        }
    }

    fn check_size(&self, recordings: &[RecordingOutline], max_elements: usize) -> Result<(), FieldError> {
        let mesh = MeshSize::Factor(self.mesh_factor);
        recordings.iter().try_for_each(|r| check_mesh(&r.specimen, mesh, "/mesh_factor", max_elements))
    }

    fn estimated_seconds(&self, recordings: &[RecordingOutline]) -> Option<f64> {
        cost::of_diagnosis(recordings, self.mesh_factor)
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        if let [_] = &context.recordings[..] {
            let (found, result) = self.diagnosed(context, 0)?;
            let mut outcome = Outcome::new("diagnosis.json", &result, summary::diagnosis(&result, &found))?;
            add_files(&mut outcome, "", &found, &result)?;
            return Ok(outcome);
        }
        let mut all = Vec::new();
        for index in 0..context.recordings.len() {
            all.push(self.diagnosed(context, index)?);
        }
        let progress = |text: &str| context.progress(&Progress::stage(&format!("all: {text}")));
        let cases: Vec<(&str, &Diagnosis)> = all.iter().map(|(d, r)| (&*r.recording, d)).collect();
        let found = match together(&cases, self.mesh_factor, &progress, &|| context.is_cancelled()) {
            Ok(found) => Some(found),
            Err(DiagnosisError::Solve(_)) if context.is_cancelled() => return Err(JobError::stopped()),
            Err(error) => {
                // What each recording told stands.
                progress(&format!("the recordings cannot be looked at together: {error}"));
                None
            }
        };
        let diagnoses: Vec<&DiagnosisResult> = all.iter().map(|(_, r)| r).collect();
        let mut text: String = all.iter().map(|(d, r)| summary::diagnosis(r, d) + "\n").collect();
        text += &summary::together(&diagnoses, found.as_ref());
        let result = Several {
            schema: "diagnoses/1",
            input_hash: &context.input_hash,
            diagnoses: diagnoses.clone(),
            together: found.as_ref(),
        };
        let mut outcome = Outcome::new("diagnoses.json", &result, text)?;
        for (index, (diagnosis, result)) in all.iter().enumerate() {
            let prefix = format!("{}-", index + 1);
            outcome.add(format!("{prefix}diagnosis.json"), super::outcome::to_json(result)?);
            add_files(&mut outcome, &prefix, diagnosis, result)?;
        }
        if let Some(found) = &found {
            let specimen = &cases[0].1.observed.specimen;
            outcome.add("together.html", together_report(found, &diagnoses, specimen).to_html());
            outcome.add_pictures(together_pictures(found, &diagnoses, specimen));
        }
        Ok(outcome)
    }
}

/// Report, pictures, and residual maps on the compared grid (measured minus predicted), by the nominal model and with
/// the causes.
fn add_files(outcome: &mut Outcome, prefix: &str, found: &Diagnosis, result: &DiagnosisResult) -> Result<(), JobError> {
    for (when, fitted) in [("before", &found.nominal), ("after", &found.corrected)] {
        let mask = &found.observed.mask;
        for (step, field) in fitted.residual.displacement.iter().enumerate() {
            let vectors = mask.spread(field, [f64::NAN; 3]);
            let name = format!("{prefix}residual_{when}_{}.nii.gz", step + 1);
            outcome.add_written(false, |folder| write_vectors(folder, &name, &mask.grid, &vectors))?;
        }
    }
    outcome.add_pictures(diagnosis_pictures(found).into_iter().map(|(name, svg)| (format!("{prefix}{name}"), svg)));
    outcome.add(format!("{prefix}material.json"), result.material.to_json());
    outcome.add(format!("{prefix}report.html"), diagnosis_report(found, result).to_html());
    Ok(())
}
