//! Synthetic campaigns: how many scans a stated precision takes where `next` chooses each, against each candidate
//! repeated.
//!
//! ```text
//! cargo run --release --example campaigns -- [DRAWS SEED]
//! ```
//!
//! A campaign ends when the posterior says that every μ and α has its precision, or after [`MOST_SCANS`]. The truth is
//! solved on a mesh of its own. The 95 % intervals at the end are compared with the truth. Changing the specimen costs
//! nothing here: scans are counted, not minutes.

use lambdak::calibration::{Observed, SyntheticScan};
use lambdak::design::Study;
use lambdak::fem::SolveOptions;
use lambdak::material::Material;
use lambdak::mesh::MeshOptions;
use lambdak::next::{NextOptions, NextResult, Plan, Precision, advise};
use lambdak::recording::Filter;
use lambdak::specimen::Specimen;
use rayon::prelude::*;
use serde_json::json;
use std::error::Error;
use std::path::Path;

type Failure = Box<dyn Error + Send + Sync>;

/// A campaign that needs more has failed, and counts as this many.
const MOST_SCANS: usize = 8;
/// Element sizes relative to standard: of the truth, fine enough that its own error is no part of what is found, and of
/// the fits, as in the command `next`.
const TRUTH_MESH: f64 = 0.8;
const FIT_MESH: f64 = 2.5;
/// Drives of every specimen, mm.
const DRIVES_MM: [f64; 2] = [2.0, 4.0];

/// A material, the precision that is asked of it, and its name.
struct Case {
    name: &'static str,
    truth: Material,
    precision: f64,
}

/// One way to choose the scans.
#[derive(Clone, Copy)]
enum Way {
    /// The first scan is the base at its smallest drive, every further one what `next` says.
    Adaptive,
    /// Always this specimen at this drive.
    Fixed(usize, f64),
}

/// How a campaign ended.
struct Campaign {
    num_scans: usize,
    is_precise: bool,
    /// Intervals that hold the truth, of so many.
    covered: [usize; 2],
}

/// All that campaigns of a material share.
struct Laboratory {
    case: Case,
    study: Study,
    specimens: Vec<Specimen>,
    /// Noiseless scans by specimen and drive.
    scans: Vec<Vec<SyntheticScan>>,
}

fn main() -> Result<(), Failure> {
    let numbers: Vec<u64> = std::env::args().skip(1).map(|n| n.parse()).collect::<Result<_, _>>()?;
    let draws = numbers.first().copied().unwrap_or(20);
    let seed = numbers.get(1).copied().unwrap_or(1);
    let cases = [
        Case { name: "one term", truth: Material::new(400.0, [(17.0, 1.91)])?, precision: 0.02 },
        Case { name: "two terms", truth: Material::new(400.0, [(12.0, 3.0), (-4.0, -3.0)])?, precision: 0.2 },
    ];
    for case in cases {
        let laboratory = Laboratory::new(case)?;
        laboratory.compare(draws, seed)?;
    }
    Ok(())
}

impl Laboratory {
    fn new(case: Case) -> Result<Laboratory, Failure> {
        let specimen = |name: &str, test: &str, [length, thickness, width]: [f64; 3]| {
            json!({ "schema": "specimen/1", "name": name, "test": test, "drive_mm": DRIVES_MM, "holes": [],
                "block": { "length_mm": length, "thickness_mm": thickness, "width_mm": width },
                "samples_in_parallel": if test == "uniaxial" { 1 } else { 2 } })
        };
        let shear = specimen("shear block", "double_lap_shear", [12.0, 4.0, 9.0]);
        let bar = specimen("bar", "uniaxial", [16.0, 4.0, 6.0]);
        let study = json!({
            "schema": "study/1", "name": "campaign", "base": shear,
            "materials": [{ "name": "truth", "material": case.truth }],
            "scan": { "voxel_mm": [1.0, 0.5, 1.0], "noise_sd_mm": [0.05, 0.05, 0.05], "force_sd_n": 0.02 },
            "vary": { "hole_count": { "min": 0, "max": 0 }, "drive_mm": { "min": DRIVES_MM[0], "max": DRIVES_MM[1] } },
            "limits": { "min_ligament_hole_hole_mm": 1.0, "min_ligament_hole_edge_mm": 1.0,
                "diameter_mm": { "min": 1.0, "max": 3.0 } }
        });
        let study = Study::from_json(&study.to_string(), Path::new("."))?;
        let specimens: Vec<Specimen> =
            [shear, bar].iter().map(|s| Specimen::from_json(&s.to_string())).collect::<Result<_, _>>()?;
        let scan = |body: &Specimen, drive: f64| -> Result<SyntheticScan, Failure> {
            let driven = Specimen { drive_mm: vec![drive], ..body.clone() };
            let mesh = MeshOptions { grading: 0.4, ..MeshOptions::scaled(&driven, TRUTH_MESH) };
            let solve = SolveOptions::default();
            Ok(SyntheticScan::new(&driven, &case.truth, &study.scan, &study.protocol, &mesh, &solve, &|| false)?)
        };
        let scans = specimens
            .iter()
            .map(|body| DRIVES_MM.iter().map(|drive| scan(body, *drive)).collect())
            .collect::<Result<Vec<Vec<SyntheticScan>>, Failure>>()?;
        Ok(Laboratory { case, study, specimens, scans })
    }

    /// A noisy recording; every `draw` has noise of its own.
    fn record(&self, body: usize, drive: usize, seed: u64, draw: u64) -> Result<Observed, Failure> {
        let scan = &self.scans[body][drive];
        let driven = Specimen { drive_mm: vec![DRIVES_MM[drive]], ..self.specimens[body].clone() };
        let recording = scan.recording("scan", &driven, &scan.draw(seed, draw), Filter::None)?;
        Ok(Observed::new(&recording, self.study.scan.force_sd_n)?)
    }

    /// What is known from `observed`, and what should come next.
    fn ask(&self, observed: &[Observed]) -> Result<NextResult, Failure> {
        let names: Vec<String> = (0..observed.len()).map(|n| format!("scan {n}")).collect();
        let plan = Plan { study: &self.study, specimens: self.specimens.clone() };
        let options = NextOptions {
            num_terms: Some(self.case.truth.terms.len()),
            mesh_factor: FIT_MESH,
            drives_mm: Some(DRIVES_MM.to_vec()),
            change_minutes: 0.0,
            precision: Precision { of_all: Some(self.case.precision), ..Precision::default() },
            ..NextOptions::default()
        };
        Ok(advise((observed, &names), &plan, &options, String::new(), &|_| (), &|| false)?)
    }

    fn campaign(&self, way: Way, seed: u64, draw: u64) -> Result<Campaign, Failure> {
        let place_of = |drive_mm: f64| DRIVES_MM.iter().position(|d| (d - drive_mm).abs() < 1e-6).unwrap_or(0);
        let (mut body, mut drive) = match way {
            Way::Adaptive => (0, 0),
            Way::Fixed(body, drive_mm) => (body, place_of(drive_mm)),
        };
        let mut observed: Vec<Observed> = Vec::new();
        loop {
            let own = draw * MOST_SCANS as u64 + observed.len() as u64;
            observed.push(self.record(body, drive, seed, own)?);
            let known = self.ask(&observed)?;
            let is_precise = known.parameters.iter().all(|p| p.relative_sd <= self.case.precision);
            if is_precise || observed.len() == MOST_SCANS {
                let truth: Vec<f64> =
                    self.case.truth.parameters()[1..].iter().map(|p| self.case.truth.value(*p)).collect();
                let holds =
                    |(p, t): (&lambdak::next::NextParameter, &f64)| (p.interval_95[0]..=p.interval_95[1]).contains(t);
                let covered = known.parameters.iter().zip(&truth).filter(|pair| holds(*pair)).count();
                return Ok(Campaign { num_scans: observed.len(), is_precise, covered: [covered, truth.len()] });
            }
            if let (Way::Adaptive, Some(best)) = (way, known.candidates.first()) {
                body = self.specimens.iter().position(|s| s.name == best.specimen).unwrap_or(0);
                drive = place_of(best.drive_mm[0]);
            }
        }
    }

    fn compare(&self, draws: u64, seed: u64) -> Result<(), Failure> {
        println!("{}: every parameter to {} %, {draws} campaigns", self.case.name, 100.0 * self.case.precision);
        println!("| scans chosen | scans, mean | reached | 95 % intervals that hold the truth |");
        println!("|---|---|---|---|");
        let fixed = (0..self.specimens.len()).flat_map(|body| DRIVES_MM.map(|drive| Way::Fixed(body, drive)));
        let mut best = f64::INFINITY;
        let mut adaptive = f64::NAN;
        for way in std::iter::once(Way::Adaptive).chain(fixed) {
            let all: Vec<Campaign> =
                (0..draws).into_par_iter().map(|draw| self.campaign(way, seed, draw)).collect::<Result<_, _>>()?;
            let mean = all.iter().map(|c| c.num_scans).sum::<usize>() as f64 / draws as f64;
            let reached = all.iter().filter(|c| c.is_precise).count();
            let covered = [0, 1].map(|n| all.iter().map(|c| c.covered[n]).sum::<usize>());
            let name = match way {
                Way::Adaptive => "by `next`".to_string(),
                Way::Fixed(body, drive) => format!("{} at {drive} mm", self.specimens[body].name),
            };
            println!("| {name} | {mean:.2} | {reached} of {draws} | {} of {} |", covered[0], covered[1]);
            match way {
                Way::Adaptive => adaptive = mean,
                Way::Fixed(..) => best = best.min(mean),
            }
        }
        println!("\nthe best fixed protocol takes {:.2} times the scans of `next`\n", best / adaptive);
        Ok(())
    }
}
