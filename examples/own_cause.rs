//! A cause of one's own: a sample that cured softer in its core than at its rim, concealed in a small recording and
//! found in it.
//!
//! ```text
//! cargo run --release --example own_cause
//! ```
//!
//! A cause is a small model with parameters that changes a [`Scene`], the experiment as it may really have been. The
//! diagnosis works out by itself how the recording would change with it, tests it beside all causes that it knows, and
//! fits it where that explains more than its parameters cost.

use lambdak::prelude::*;
use std::error::Error;
use std::sync::Arc;

/// The sample is softer in its core than at its free ends, as rubber that cures from its faces inwards.
struct SoftCore {
    /// Half of the block's length, mm.
    half_length_mm: f64,
}

impl Cause for SoftCore {
    fn name(&self) -> CauseName {
        CauseName::new("soft_core")
    }

    fn category(&self) -> Category {
        Category::Material
    }

    fn description(&self) -> String {
        "the sample cured softer in its core than at its ends".into()
    }

    fn remedy(&self) -> String {
        "Cure longer, and test a slice from the core.".into()
    }

    /// One number, zero in the nominal experiment: the logarithm of the ends' stiffness over the core's. A tenth would
    /// be plain to see, and a factor of twenty is beyond belief.
    fn parameters(&self) -> Vec<CauseParameter> {
        vec![CauseParameter::new("log_stiffness_ends_over_core", 0.1, [-3.0, 3.0])]
    }

    /// Factors on the stiffness multiply, so that several causes may change it at once. The mean of their logarithm over
    /// the length is kept: a sample that is stiffer throughout is another material.
    fn apply(&self, values: &[f64], scene: &mut Scene) {
        let (contrast, half_length) = (values[0], self.half_length_mm);
        scene.stiffness.push(Field::new(move |x| (contrast * ((x[0] / half_length).powi(2) - 1.0 / 3.0)).exp()));
    }
}

/// What is concealed: the ends are e^0.8 = 2.2 times as stiff as the core.
const CONTRAST: f64 = 0.8;
/// Standard deviation of the displacement's noise, mm, and of the force's, N.
const NOISE_MM: f64 = 0.01;
const FORCE_SD_N: f64 = 0.01;
/// Coarse, so that the example takes seconds. A diagnosis corrects its mesh by one whose elements are 0.6 times as
/// large: the recording is made on that one.
const MESH_FACTOR: f64 = 4.0;

fn main() -> Result<(), Box<dyn Error>> {
    let mut specimen = Specimen::from_json(include_str!("../geometries/solid-shear.json"))?;
    specimen.drive_mm = vec![2.0, 4.0];
    let cause = Arc::new(SoftCore { half_length_mm: 0.5 * specimen.block.length_mm });
    let recording = recorded(&specimen, &*cause)?;

    let registry = Registry::standard().with(cause)?;
    let options = DiagnosisOptions {
        mesh_factor: MESH_FACTOR,
        allowance_mm: Some(0.005),
        force_sd_n: FORCE_SD_N,
        max_causes: 1,
        ..DiagnosisOptions::default()
    };
    let diagnosis = diagnose_with(&registry, &recording, &options, &|stage| eprintln!("{stage}"), &|| false)?;

    let result = DiagnosisResult::new(&diagnosis, &recording.id, String::new());
    println!("verdict: {:?}", result.verdict);
    for cause in &result.causes {
        println!("{}: {}. {}", cause.name, cause.description, cause.remedy);
        for p in &cause.parameters {
            match p.interval_95 {
                Some([low, high]) => println!("  {} = {:.3} ({low:.3} to {high:.3})", p.name, p.value),
                None => println!("  {} = {:.3}, not bounded", p.name, p.value),
            }
        }
    }
    println!("concealed: soft_core, {CONTRAST}");
    Ok(())
}

/// A noisy recording of a sample in which `cause` is at work.
fn recorded(specimen: &Specimen, cause: &dyn Cause) -> Result<Recording, Box<dyn Error>> {
    let material = Material::new(2173.0, [(17.0, 1.91)])?;
    let mask = VoxelMask::covering(specimen, [2.5, 0.8, 2.5])?;
    let empty = |drive_mm: f64| RecordedStep {
        drive_mm,
        force_n: None,
        force_sd_n: Some(FORCE_SD_N),
        window_s: None,
        displacement: vec![[0.0; 3]; mask.grid.num_voxels()],
    };
    let mut recording = Recording {
        id: "soft core".into(),
        steps: specimen.drive_mm.iter().map(|drive| empty(*drive)).collect(),
        specimen: specimen.clone(),
        grid: mask.grid.clone(),
        mask: mask.spread(&vec![true; mask.num_voxels()], false),
        noise_sd_mm: Some([NOISE_MM; 3]),
        filter: Filter::None,
        load: None,
        notes: None,
    };
    let observed = Observed::new(&recording, FORCE_SD_N)?;
    let mesh = MeshOptions::scaled(&observed.specimen, 0.6 * MESH_FACTOR);
    let mut scene = Scene::default();
    cause.apply(&[CONTRAST], &mut scene);
    let seen = Laboratory::new(&observed, &mesh)?.predict(&material, &scene, &|| false)?.trace;
    let mut noise = Noise(1);
    for (n, step) in recording.steps.iter_mut().enumerate() {
        let noisy: Vec<[f64; 3]> =
            seen.displacement[n].iter().map(|u| u.map(|x| x + NOISE_MM * noise.draw())).collect();
        step.displacement = observed.mask.spread(&noisy, [f64::NAN; 3]);
        step.force_n = Some(seen.force[n]);
    }
    Ok(recording)
}

/// Numbers that stand for noise: near Gaussian, of unit variance, the same in every run.
struct Noise(u64);

impl Noise {
    /// The sum of twelve uniform numbers less six.
    fn draw(&mut self) -> f64 {
        let mut uniform = || {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }
}
