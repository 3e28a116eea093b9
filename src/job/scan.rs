//! Scan: a synthetic recording of a specimen as the scanner and the load cell would give it.

use super::outcome::{RECORDING_FIELD, WithRecording, recording_identifier, to_json};
use super::subject::{check_meshes, driven, name_of_sample};
use super::{Context, JobError, Outcome, RecordingOutline, Request, ResultSchema, Run, cost, defaults, summary};
use crate::acquisition::{
    CameraOptions, KSpace, LoadProgram, ReconstructOptions, Reconstruction, Scan, ScanOptions, ScanResult, Window,
    film, reconstruct, scan,
};
use crate::fem::SolveOptions;
use crate::field::FieldError;
use crate::field::schema::Seed;
use crate::material::Material;
use crate::mesh::{MeshOptions, MeshSize};
use crate::provenance::VERSION;
use crate::recording::{Filter, write_vectors};
use crate::report::{displacement_picture, raw_picture};
use crate::specimen::Specimen;
use crate::voxel::{Surface, VoxelError, VoxelGrid};
use serde::{Deserialize, Serialize};
use serde_json::json;
use utoipa::ToSchema;

/// Voxels around the specimen from which noise is estimated.
const MARGIN_VOXELS: usize = 3;
/// Noise of a full voxel's displacement where none is given, mm.
const NOISE_SD_MM: [f64; 3] = [0.01; 3];
/// Most voxels of a scan.
const MAX_VOXELS: usize = 2_000_000;

/// What is lost of k-space.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct KSpaceRequest {
    /// Part kept along x, y, z, each above 0 and at most 1.
    #[serde(default = "all_of_kspace")]
    #[schema(min_items = 3, max_items = 3, default = all_of_kspace)]
    pub keep: [f64; 3],
    /// Weight the kept part with a Hamming window.
    #[serde(default)]
    pub is_apodised: bool,
}

fn all_of_kspace() -> [f64; 3] {
    [1.0; 3]
}

/// Body of a scan.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ScanRequest {
    /// The specimen (`specimen/1`).
    pub specimen: Specimen,
    /// The material, Ogden's or another law; Ecoflex 00-20 where it is left out.
    #[serde(default = "defaults::ecoflex")]
    pub material: Material,
    /// Drives in mm instead of the specimen's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 1000)]
    pub drive_mm: Option<Vec<f64>>,
    /// Which kind of the specimen's samples is scanned, from 1 in the order in which they are listed. The force of all
    /// samples is in the recording of the first kind alone, so that it counts once where several are calibrated
    /// together.
    #[serde(default = "first_sample")]
    #[schema(minimum = 1, maximum = 8, default = first_sample)]
    pub sample: usize,
    /// Element size.
    #[serde(default)]
    #[schema(default = MeshSize::default)]
    pub mesh: MeshSize,
    /// Mesh the whole specimen even where it has mirror planes.
    #[serde(default)]
    pub is_whole: bool,
    /// Name that the recording begins with; the specimen's where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 200)]
    pub name: Option<String>,
    /// Edges of a voxel, mm; where cameras see a surface, the two in the face are those of a subset.
    #[serde(default = "defaults::voxel_mm")]
    #[schema(min_items = 3, max_items = 3, default = defaults::voxel_mm)]
    pub voxel_mm: [f64; 3],
    /// The face that cameras see (digital image correlation), in place of a scan of the volume: displacements of its
    /// subsets with noise, and no phases.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub surface: Option<Surface>,
    /// Offset of the grid from the specimen's centre in voxels, each from −1 to 1.
    #[serde(default)]
    #[schema(min_items = 3, max_items = 3, default = no_offset)]
    pub offset_voxels: [f64; 3],
    /// Signal-to-noise ratio of a full voxel along x, y, z; from the noise where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 3, max_items = 3)]
    pub snr: Option<[f64; 3]>,
    /// Noise of a full voxel's displacement, mm, one standard deviation; 0.01 where neither it nor the ratio is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 3, max_items = 3)]
    pub noise_sd_mm: Option<[f64; 3]>,
    /// Displacement per phase, mm/rad: a turn is 2π times this. By default one turn per millimetre.
    #[serde(default = "mm_per_radian")]
    #[schema(min_items = 3, max_items = 3, default = mm_per_radian)]
    pub mm_per_radian: [f64; 3],
    /// Filter on the displacements.
    #[serde(default)]
    #[schema(default = Filter::default)]
    pub filter: Filter,
    /// What is lost of k-space; nothing where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kspace: Option<KSpaceRequest>,
    /// Noise of the load cell's mean (slow drift), N, one standard deviation.
    #[serde(default = "defaults::force_sd_n")]
    #[schema(minimum = 0.0, maximum = 1e9, default = defaults::force_sd_n)]
    pub force_sd_n: f64,
    /// Leave wrapped phases and magnitudes instead of displacements.
    #[serde(default)]
    pub is_raw: bool,
    /// Seed of all noise.
    #[serde(default = "seed")]
    #[schema(value_type = Seed, default = seed)]
    pub seed: u64,
}

fn no_offset() -> [f64; 3] {
    [0.0; 3]
}

fn mm_per_radian() -> [f64; 3] {
    [0.5 * std::f64::consts::FRAC_1_PI; 3]
}

fn first_sample() -> usize {
    1
}

fn seed() -> u64 {
    1
}

/// What records the specimen.
enum Recorder {
    Scanner(ScanOptions),
    Cameras(CameraOptions),
}

struct CheckedScan {
    request: ScanRequest,
    /// At the drives that are asked for.
    specimen: Specimen,
    recorder: Recorder,
}

impl ScanRequest {
    /// The settings of scanner or cameras; what is wrong is added to `errors`.
    fn recorder(&self, specimen: &Specimen, errors: &mut Vec<FieldError>) -> Option<Recorder> {
        match self.surface {
            Some(surface) => self.cameras(surface, specimen, errors).map(Recorder::Cameras),
            None => self.scanner(specimen, errors).map(Recorder::Scanner),
        }
    }

    /// The sample that is recorded.
    fn recorded(&self, specimen: &Specimen, errors: &mut Vec<FieldError>) -> Option<Specimen> {
        let samples = specimen.samples();
        let sample = samples.get(self.sample.wrapping_sub(1));
        if sample.is_none() {
            let allowed = format!("from 1 to {}, the specimen's kinds of samples", samples.len());
            errors.push(FieldError::new("/sample", self.sample, allowed));
        }
        sample.cloned()
    }

    fn load(&self) -> LoadProgram {
        LoadProgram { drift_sd_n: self.force_sd_n, ..LoadProgram::default() }
    }

    /// A grid of at most so many voxels.
    fn limited(&self, grid: Result<VoxelGrid, String>, errors: &mut Vec<FieldError>) -> Option<VoxelGrid> {
        let unfit = |allowed: String| FieldError::new("/voxel_mm", format!("{:?}", self.voxel_mm), allowed);
        match grid {
            Ok(grid) if grid.num_voxels() <= MAX_VOXELS => return Some(grid),
            Ok(grid) => {
                let error = unfit(format!("large enough for at most {MAX_VOXELS} voxels"));
                errors.push(error.remedy(format!("these make {}: use larger voxels", grid.num_voxels())));
            }
            Err(error) => errors.push(unfit("usable".into()).remedy(error)),
        }
        None
    }

    /// The cameras' settings.
    fn cameras(&self, surface: Surface, specimen: &Specimen, errors: &mut Vec<FieldError>) -> Option<CameraOptions> {
        let of_scanner = [
            ("snr", self.snr.is_some()),
            ("kspace", self.kspace.is_some()),
            ("is_raw", self.is_raw),
            ("filter", self.filter != Filter::None),
            ("mm_per_radian", self.mm_per_radian != mm_per_radian()),
            ("offset_voxels", self.offset_voxels != no_offset()),
        ];
        for (name, _) in of_scanner.into_iter().filter(|(_, is_given)| *is_given) {
            let error = FieldError::new(format!("/{name}"), "given", "left out where a surface is seen");
            errors.push(
                error.remedy("cameras have neither phases nor a grid that lies anywhere; noise_sd_mm is their noise"),
            );
        }
        for (axis, value) in self.noise_sd_mm.into_iter().flatten().enumerate() {
            if !(value > 1e-100 && value <= 1e100) {
                errors.push(FieldError::new(format!("/noise_sd_mm/{axis}"), value, "above 0 and finite"));
            }
        }
        let sample = self.recorded(specimen, errors)?;
        let grid = match VoxelGrid::planned(&sample, self.voxel_mm, Some(surface)) {
            Err(error @ VoxelError::HiddenFace { .. }) => {
                let allowed = "a plane face that cameras can see";
                let unfit = FieldError::new("/surface/face", surface.face.name(), allowed);
                errors.push(unfit.remedy(error.to_string()));
                return None;
            }
            other => self.limited(other.map_err(|e| e.to_string()), errors)?,
        };
        let noise_sd_mm = self.noise_sd_mm.unwrap_or(NOISE_SD_MM);
        Some(CameraOptions { grid, noise_sd_mm, load: self.load(), seed: self.seed, sample: self.sample - 1 })
    }

    /// The scanner's settings.
    fn scanner(&self, specimen: &Specimen, errors: &mut Vec<FieldError>) -> Option<ScanOptions> {
        if let (Some(snr), Some(_)) = (self.snr, self.noise_sd_mm) {
            let error = FieldError::new("/snr", format!("{snr:?}"), "left out where noise_sd_mm is given");
            errors.push(error.remedy("give one of the two"));
        }
        let triples =
            [("mm_per_radian", Some(self.mm_per_radian)), ("noise_sd_mm", self.noise_sd_mm), ("snr", self.snr)];
        for (name, values) in triples {
            for (axis, value) in values.into_iter().flatten().enumerate() {
                if !(value > 1e-100 && value <= 1e100) {
                    errors.push(FieldError::new(format!("/{name}/{axis}"), value, "above 0 and finite"));
                }
            }
        }
        for (axis, value) in self.offset_voxels.into_iter().enumerate() {
            crate::field::within(errors, &format!("/offset_voxels/{axis}"), value, -1.0..=1.0);
        }
        let window = |k: &KSpaceRequest| if k.is_apodised { Window::Hamming } else { Window::None };
        let kspace = self.kspace.map(|k| KSpace { keep: k.keep, window: window(&k) });
        if let Some(Err(error)) = kspace.map(|k| k.check()) {
            let keep = kspace.map(|k| k.keep).unwrap_or_default();
            let allowed = "above 0 and at most 1 along each axis";
            errors.push(FieldError::new("/kspace/keep", format!("{keep:?}"), allowed).remedy(error.to_string()));
        }
        let sample = self.recorded(specimen, errors);
        if !errors.is_empty() {
            return None;
        }
        let around = ScanOptions::grid_around(&sample?, self.voxel_mm, MARGIN_VOXELS, self.offset_voxels);
        let grid = self.limited(around.map_err(|e| e.to_string()), errors)?;
        let noise = self.noise_sd_mm.unwrap_or(NOISE_SD_MM);
        let snr = self.snr.unwrap_or([0, 1, 2].map(|axis| self.mm_per_radian[axis] / noise[axis]));
        let (load, sample) = (self.load(), self.sample - 1);
        Some(ScanOptions { grid, mm_per_radian: self.mm_per_radian, snr, kspace, load, seed: self.seed, sample })
    }
}

impl Request for ScanRequest {
    const COMMAND: &'static str = "scan";
    const COLLECTION: &'static str = "scans";
    const ABOUT: &'static str =
        "A synthetic MR-u recording of a specimen: phases with noise, unwrapped, and the loading history.";

    fn example() -> serde_json::Value {
        serde_json::json!({ "specimen": defaults::two_hole_shear(), "material": defaults::ecoflex(), "snr": [20.0, 20.0, 20.0], "seed": 7 })
    }

    fn result() -> ResultSchema {
        ResultSchema::with::<ScanResult>("scan/1", &[("recording", RECORDING_FIELD)])
    }

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        let mut errors = Vec::new();
        let specimen = driven(&self.specimen, self.drive_mm.as_ref(), &mut errors);
        errors.extend(self.material.field_errors().into_iter().map(|e| e.below("/material")));
        if self.is_raw && self.filter != Filter::None {
            let error = FieldError::new("/filter", json!(self.filter), "none where raw phases are asked for");
            errors.push(error.remedy("the filter belongs to displacements; leave out one of the two"));
        }
        match self.recorder(&specimen, &mut errors) {
            Some(recorder) if errors.is_empty() => Ok(Box::new(CheckedScan { request: self, specimen, recorder })),
            _ => Err(errors),
        }
    }
}

impl Run for CheckedScan {
    fn title(&self) -> String {
        format!("scan of {}", self.specimen.name)
    }

    fn check_size(&self, _: &[RecordingOutline], max_elements: usize) -> Result<(), FieldError> {
        check_meshes(&self.specimen, self.request.mesh, "/mesh", max_elements)
    }

    fn estimated_seconds(&self, _: &[RecordingOutline]) -> Option<f64> {
        let mut mesh = self.request.mesh.options(&self.specimen);
        mesh.use_mirror &= !self.request.is_whole;
        cost::seconds(
            &self.specimen,
            &mesh,
            Some((self.request.voxel_mm, self.request.surface)),
            self.specimen.drive_mm.len(),
        )
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        context.step(&format!("scanning at {} drives", self.specimen.drive_mm.len()), 0, 3);
        let (result, mut outcome) = match &self.recorder {
            Recorder::Scanner(options) => self.scanned(options, context)?,
            Recorder::Cameras(options) => self.filmed(options, context)?,
        };
        outcome.summary = summary::scan(&self.specimen.name, &result);
        let named = WithRecording { result: &result, recording: recording_identifier(&outcome.recording()) };
        (outcome.result, outcome.result_name) = (to_json(&named)?, "scan-result.json");
        let truth = json!({ "material": self.request.material, "scan": result });
        outcome.add("scan.json", to_json(&truth)?);
        outcome.add("material.json", self.request.material.to_json());
        Ok(outcome)
    }
}

impl CheckedScan {
    fn mesh(&self, context: &Context) -> MeshOptions {
        let mut mesh = self.request.mesh.options(&self.specimen);
        mesh.use_mirror &= !self.request.is_whole;
        mesh.max_elements = mesh.max_elements.min(context.surroundings.max_elements());
        mesh
    }

    /// The recording's name.
    fn id(&self) -> String {
        let name = self.request.name.as_ref().unwrap_or(&self.specimen.name);
        name_of_sample(&format!("{}-seed-{}", plain(name), self.request.seed), self.request.sample - 1)
    }

    /// What the recording says of its making.
    fn notes(&self, context: &Context) -> Option<serde_json::Value> {
        let (hash, seed) = (&context.input_hash, self.request.seed);
        Some(json!({
            "synthetic": { "program": format!("lambdak {VERSION}"), "input_hash": hash, "seed": seed },
        }))
    }

    /// The result and the files of a scanner.
    fn scanned(&self, options: &ScanOptions, context: &Context) -> Result<(ScanResult, Outcome), JobError> {
        let (mesh, solve, cancelled) = (self.mesh(context), SolveOptions::default(), || context.is_cancelled());
        let material = &self.request.material;
        let mut made = scan(&self.id(), &self.specimen, material, &mesh, &solve, options, &cancelled)
            .map_err(|e| context.failed(&e))?;
        made.raw.notes = self.notes(context);
        context.step("reconstruct", 1, 3);
        let found = if self.request.is_raw {
            None
        } else {
            let settings = ReconstructOptions { filter: self.request.filter, ..ReconstructOptions::default() };
            Some(reconstruct(&made.raw, &settings).map_err(|e| context.failed(&e))?)
        };
        context.step("files", 2, 3);
        let hash = context.input_hash.clone();
        let result = ScanResult::new(&made, options, found.as_ref(), hash).map_err(|e| context.failed(&e))?;
        let mut outcome = Outcome::default();
        add_files(&mut outcome, &made, found.as_ref())?;
        Ok((result, outcome))
    }

    /// The result and the files of cameras.
    fn filmed(&self, options: &CameraOptions, context: &Context) -> Result<(ScanResult, Outcome), JobError> {
        let (mesh, solve, cancelled) = (self.mesh(context), SolveOptions::default(), || context.is_cancelled());
        let material = &self.request.material;
        let mut made = film(&self.id(), &self.specimen, material, &mesh, &solve, options, &cancelled)
            .map_err(|e| context.failed(&e))?;
        made.recording.notes = self.notes(context);
        context.step("files", 2, 3);
        let mut outcome = Outcome::default();
        outcome.add_written(true, |folder| made.recording.write(folder))?;
        for n in 0..made.recording.steps.len() {
            outcome.add(format!("displacement_{}.svg", n + 1), displacement_picture(&made.recording, n));
        }
        Ok((ScanResult::of_cameras(&made, options, context.input_hash.clone()), outcome))
    }
}

/// The recording, the estimated noise of every voxel, pictures.
fn add_files(outcome: &mut Outcome, made: &Scan, found: Option<&Reconstruction>) -> Result<(), JobError> {
    match found {
        None => outcome.add_written(true, |folder| made.raw.write(folder))?,
        Some(found) => {
            outcome.add_written(true, |folder| found.recording.write(folder))?;
            for (n, sd) in found.sd_mm.iter().enumerate() {
                let name = format!("sd_{}.nii.gz", n + 1);
                outcome.add_written(false, |folder| write_vectors(folder, &name, &found.recording.grid, sd))?;
            }
        }
    }
    for n in 0..made.raw.steps.len() {
        outcome.add(format!("raw_{}.svg", n + 1), raw_picture(&made.raw, n));
        if let Some(found) = found {
            outcome.add(format!("displacement_{}.svg", n + 1), displacement_picture(&found.recording, n));
        }
    }
    Ok(())
}

/// A recording's name from a specimen's or file's.
fn plain(name: &str) -> String {
    let text: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect();
    let parts: Vec<&str> = text.split('-').filter(|p| !p.is_empty()).collect();
    if parts.is_empty() { "scan".into() } else { parts.join("-").chars().take(60).collect() }
}
