//! Synthetic campaigns: how many scans a stated precision takes where `next` chooses each, against the best protocol
//! that is fixed beforehand.
//!
//! ```text
//! cargo run --release --example campaigns -- [DRAWS SEED [TERMS [GAIN [TRUTH]]]]
//! ```
//!
//! The laboratory knows what kind of material it has, but not which: a fixed protocol has to suit every material of the
//! kind, the limit of the load cell included. Fixed protocols are every drive that holds the limit with all of them, again
//! and again, and every two such drives by turns. `next` starts as the protocol of the largest such drive does. A campaign
//! ends when the posterior says that every μ and α has its precision, or after [`MOST_SCANS`]. The truth is solved on
//! a mesh of its own. The 95 % intervals at the end are compared with the truth.
//!
//! With GAIN, 0.005 say, every campaign has a load cell of its own that reads so much too much, to one standard
//! deviation, in all its scans alike, and that is known of it.
//!
//! TRUTH is the element size of the mesh that the truth is solved on, relative to standard, 0.5 where it is left out:
//! finer elements go on to show more at the bonded edges, and a sample has none.

use lambdak::calibration::{CalibrationError, Observed, SyntheticScan};
use lambdak::design::Study;
use lambdak::fem::{SolveError, SolveOptions};
use lambdak::material::Material;
use lambdak::mesh::MeshOptions;
use lambdak::next::{NextOptions, NextParameter, NextResult, Plan, Precision, advise};
use lambdak::recording::Filter;
use lambdak::sensitivity::Protocol;
use lambdak::specimen::Specimen;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use serde_json::json;
use std::error::Error;
use std::path::Path;

type Failure = Box<dyn Error + Send + Sync>;

/// A campaign that needs more has failed, and counts as this many.
const MOST_SCANS: usize = 8;
/// Of one material and way to choose the scans.
const MOST_CAMPAIGNS: u64 = 1000;
/// Element size of the truth relative to standard where none is given: so fine that its own error (0.1 % of the force) is
/// less than what noise leaves.
const TRUTH_MESH: f64 = 0.5;
/// Element size of the fits, as in the command `next`.
const FIT_MESH: f64 = 2.5;
/// Drives that may be scanned, mm.
const DRIVES_MM: [f64; 5] = [2.0, 3.0, 4.0, 5.0, 6.0];
/// What the load cell bears, N.
const MOST_FORCE_N: f64 = 10.0;

/// A kind of material, those of it that campaigns are run with, and the precision that is asked.
struct Kind {
    name: &'static str,
    truths: Vec<Material>,
    precision: f64,
}

/// What is the same in all campaigns.
struct Laboratory {
    /// Of the load cell.
    gain_sd: f64,
    /// Element size of the truth relative to standard.
    truth_mesh: f64,
}

/// One way to choose the scans; drives by their place among [`DRIVES_MM`].
#[derive(Clone)]
enum Way {
    /// The first scan at this drive, every further one as `next` says.
    Adaptive(usize),
    /// These drives by turns.
    Fixed(Vec<usize>),
}

/// How a campaign ended.
struct Campaign {
    num_scans: usize,
    is_precise: bool,
    /// Intervals that hold the truth, of so many.
    covered: [usize; 2],
    /// Errors of all estimates over the standard deviations told, squared and summed.
    sum_of_squares: f64,
}

/// Campaigns of one way.
#[derive(Default)]
struct Tally {
    num_campaigns: usize,
    num_scans: usize,
    reached: usize,
    covered: [usize; 2],
    sum_of_squares: f64,
}

/// A material to be measured.
struct Sample<'a> {
    /// Its place among the materials of its kind.
    place: u64,
    truth: &'a Material,
    precision: f64,
    study: &'a Study,
    /// Noiseless scans by drive; none where the sample gives way before.
    scans: Vec<Option<SyntheticScan>>,
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let numbers: Vec<u64> = arguments.iter().take(3).map(|n| n.parse()).collect::<Result<_, _>>()?;
    let laboratory = Laboratory {
        gain_sd: arguments.get(3).map_or(Ok(0.0), |gain| gain.parse())?,
        truth_mesh: arguments.get(4).map_or(Ok(TRUTH_MESH), |size| size.parse())?,
    };
    let draws = numbers.first().copied().unwrap_or(20).min(MOST_CAMPAIGNS);
    let seed = numbers.get(1).copied().unwrap_or(1);
    let of = |terms: &[(f64, f64)]| Material::new(400.0, terms.iter().copied());
    let kinds = [
        Kind {
            name: "one term",
            truths: vec![of(&[(6.0, 2.5)])?, of(&[(17.0, 1.91)])?, of(&[(25.0, 3.0)])?],
            precision: 0.01,
        },
        Kind {
            name: "two terms",
            truths: vec![
                of(&[(8.0, 2.5), (-6.0, -2.5)])?,
                of(&[(12.0, 3.0), (-4.0, -3.0)])?,
                of(&[(15.0, 3.0), (-5.0, -3.0)])?,
            ],
            precision: 0.2,
        },
    ];
    for kind in kinds {
        let num_terms = kind.truths[0].terms.len() as u64;
        if numbers.get(2).is_none_or(|asked| *asked == num_terms) {
            kind.compare(draws, seed, &laboratory)?;
        }
    }
    Ok(())
}

/// The block that is scanned, and what is planned with it.
fn study(kind: &Kind, gain_sd: f64) -> Result<Study, Failure> {
    let study = json!({
        "schema": "study/1", "name": "campaign",
        "base": { "schema": "specimen/1", "name": "shear block", "test": "double_lap_shear", "drive_mm": DRIVES_MM,
            "block": { "length_mm": 12.0, "thickness_mm": 4.0, "width_mm": 9.0 }, "holes": [], "samples_in_parallel": 2 },
        "materials": [{ "name": "of this kind", "material": kind.truths[0] }],
        "scan": { "voxel_mm": [1.0, 0.5, 1.0], "noise_sd_mm": [0.05, 0.05, 0.05], "force_sd_n": 0.02 },
        "protocol": { "force_gain_sd": gain_sd },
        "vary": { "hole_count": { "min": 0, "max": 0 }, "drive_mm": { "min": DRIVES_MM[0], "max": 6.0 } },
        "limits": { "min_ligament_hole_hole_mm": 1.0, "min_ligament_hole_edge_mm": 1.0, "max_force_n": MOST_FORCE_N,
            "diameter_mm": { "min": 1.0, "max": 3.0 } }
    });
    Ok(Study::from_json(&study.to_string(), Path::new("."))?)
}

/// The study's block at one drive.
fn driven(study: &Study, drive: usize) -> Specimen {
    Specimen { drive_mm: vec![DRIVES_MM[drive]], ..study.base.clone() }
}

impl Sample<'_> {
    fn new<'a>(place: usize, (kind, study): (&'a Kind, &'a Study), truth_mesh: f64) -> Result<Sample<'a>, Failure> {
        let truth = &kind.truths[place];
        let scan = |drive: usize| -> Result<Option<SyntheticScan>, Failure> {
            let body = driven(study, drive);
            let mesh = MeshOptions { grading: 0.4, ..MeshOptions::scaled(&body, truth_mesh) };
            let solve = SolveOptions::default();
            // A scan of its own would have a gain of its own.
            match SyntheticScan::new(&body, truth, &study.scan, &Protocol::default(), &mesh, &solve, &|| false) {
                Ok(scan) => Ok(Some(scan)),
                Err(CalibrationError::Solve(SolveError::Diverged { .. })) => Ok(None),
                Err(error) => Err(error.into()),
            }
        };
        let scans = (0..DRIVES_MM.len()).map(scan).collect::<Result<_, _>>()?;
        Ok(Sample { place: place as u64, truth, precision: kind.precision, study, scans })
    }

    /// The noisy recording of one scan of a campaign. Every material, campaign and scan has noise of its own; ways to
    /// choose the scans share it.
    fn record(&self, drive: usize, seed: u64, campaign: u64, num_before: usize) -> Result<Observed, Failure> {
        let scan = self.scans[drive].as_ref().ok_or("a drive at which the sample gives way")?;
        let own = (self.place * MOST_CAMPAIGNS + campaign) * MOST_SCANS as u64 + num_before as u64;
        let recording = scan.recording("scan", &driven(self.study, drive), &scan.draw(seed, own), Filter::None)?;
        let (protocol, force_sd_n) = (&self.study.protocol, self.study.scan.force_sd_n);
        let mut observed = Observed::new(&recording, force_sd_n)?.with_protocol(&recording, protocol, force_sd_n)?;
        let gain = self.gain(seed, campaign);
        observed.forces_mut().flatten().for_each(|force| force.value_n *= gain);
        Ok(observed)
    }

    /// Of a campaign's load cell.
    fn gain(&self, seed: u64, campaign: u64) -> f64 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        // Streams of the noise count up from zero, these down from the top.
        random.set_stream(u64::MAX - (self.place * MOST_CAMPAIGNS + campaign));
        let sds: f64 = StandardNormal.sample(&mut random);
        1.0 + self.study.protocol.force_gain_sd * sds
    }

    /// What is known from `observed`, and which of `drives_mm` should come next.
    fn ask(&self, observed: &[Observed], drives_mm: &[f64]) -> Result<NextResult, Failure> {
        let names: Vec<String> = (0..observed.len()).map(|n| format!("scan {n}")).collect();
        let plan = Plan { study: self.study, specimens: vec![self.study.base.clone()] };
        let options = NextOptions {
            num_terms: Some(self.truth.terms.len()),
            mesh_factor: FIT_MESH,
            drives_mm: Some(drives_mm.to_vec()),
            precision: Precision { of_all: Some(self.precision), ..Precision::default() },
            ..NextOptions::default()
        };
        Ok(advise((observed, &names), &plan, &options, String::new(), &|_| (), &|| false)?)
    }

    /// The largest standard deviation over its precision.
    fn over_precision(&self, known: &NextResult) -> f64 {
        known.parameters.iter().map(|p| p.relative_sd / self.precision).fold(0.0, f64::max)
    }

    fn campaign(&self, way: &Way, seed: u64, campaign: u64) -> Result<Campaign, Failure> {
        let mut observed: Vec<Observed> = Vec::new();
        let mut next = 0;
        // A fixed protocol takes no advice: a single candidate saves time.
        let candidates_mm: Vec<f64> = match way {
            Way::Adaptive(_) => {
                (0..DRIVES_MM.len()).filter(|d| self.scans[*d].is_some()).map(|d| DRIVES_MM[d]).collect()
            }
            Way::Fixed(_) => vec![DRIVES_MM[0]],
        };
        loop {
            let drive = match way {
                Way::Adaptive(first) if observed.is_empty() => *first,
                Way::Adaptive(_) => next,
                Way::Fixed(drives) => drives[observed.len() % drives.len()],
            };
            observed.push(self.record(drive, seed, campaign, observed.len())?);
            let known = self.ask(&observed, &candidates_mm)?;
            let is_precise = self.over_precision(&known) <= 1.0;
            if is_precise || observed.len() == MOST_SCANS {
                let truth: Vec<f64> = self.truth.parameters()[1..].iter().map(|p| self.truth.value(*p)).collect();
                let of_truth = || known.parameters.iter().zip(&truth);
                let covered = of_truth().filter(|(p, t)| (p.interval_95[0]..=p.interval_95[1]).contains(t)).count();
                // What intervals are made of: noise and misfit, and the mesh.
                let sd = |p: &NextParameter| p.value.abs() * p.relative_sd.hypot(p.discretisation_relative_sd);
                let sum_of_squares = of_truth().map(|(p, t)| ((p.value - t) / sd(p)).powi(2)).sum();
                let covered = [covered, truth.len()];
                return Ok(Campaign { num_scans: observed.len(), is_precise, covered, sum_of_squares });
            }
            let best_mm = known.candidates[0].drive_mm[0];
            next = DRIVES_MM.iter().position(|d| (d - best_mm).abs() < 1e-6).ok_or("a drive that is no candidate")?;
        }
    }

    /// Whether as many scans as may be of a fixed protocol have the precision.
    fn reaches(&self, drives: &[usize], seed: u64) -> Result<bool, Failure> {
        let record = |n: usize| self.record(drives[n % drives.len()], seed, 0, n);
        let observed = (0..MOST_SCANS).map(record).collect::<Result<Vec<_>, _>>()?;
        Ok(self.over_precision(&self.ask(&observed, &DRIVES_MM[..1])?) <= 1.0)
    }
}

impl Kind {
    fn compare(&self, draws: u64, seed: u64, laboratory: &Laboratory) -> Result<(), Failure> {
        let study = study(self, laboratory.gain_sd)?;
        let samples: Vec<Sample> = (0..self.truths.len())
            .into_par_iter()
            .map(|place| Sample::new(place, (self, &study), laboratory.truth_mesh))
            .collect::<Result<_, _>>()?;
        let holds = |drive: &usize| {
            let is_borne = |scan: &SyntheticScan| scan.noiseless().forces_n[0] <= MOST_FORCE_N;
            samples.iter().all(|sample| sample.scans[*drive].as_ref().is_some_and(is_borne))
        };
        let allowed: Vec<usize> = (0..DRIVES_MM.len()).filter(holds).collect();
        let largest = *allowed.last().ok_or("no drive holds the limit of the load cell with every material")?;
        let alone = allowed.iter().map(|drive| vec![*drive]);
        let by_turns = allowed.iter().flat_map(|a| allowed.iter().filter(move |b| *b > a).map(|b| vec![*b, *a]));
        let fixed: Vec<Vec<usize>> = alone.chain(by_turns).collect();

        println!("{}: every parameter to {} %, {draws} campaigns of each material", self.name, 100.0 * self.precision);
        println!(
            "| scans | {} | mean | reached | 95 % intervals that hold the truth | rms error over standard deviation |",
            self.truth_names().join(" | ")
        );
        println!("|---|{}---|---|---|---|", "---|".repeat(samples.len()));
        let (adaptive, mut covered) = row("by `next`", &samples, &Way::Adaptive(largest), draws, seed)?;
        let mut best = f64::INFINITY;
        for drives in fixed {
            let name = drives.iter().map(|d| DRIVES_MM[*d].to_string()).collect::<Vec<_>>().join(" and ") + " mm";
            // Where one campaign of a material fails its mean is far from the best: no further ones are run.
            let reached = samples.par_iter().map(|s| s.reaches(&drives, seed)).collect::<Result<Vec<_>, _>>()?;
            if reached.contains(&false) {
                println!(
                    "| {name} | {}| more than {MOST_SCANS} | not tried further | | |",
                    "| ".repeat(samples.len() - 1)
                );
                continue;
            }
            let (mean, held) = row(&name, &samples, &Way::Fixed(drives), draws, seed)?;
            best = best.min(mean);
            (0..2).for_each(|n| covered[n] += held[n]);
        }
        println!("\nthe best fixed protocol takes {:.2} times the scans of `next`", best / adaptive);
        println!("of all intervals {} of {} hold the truth\n", covered[0], covered[1]);
        Ok(())
    }

    fn truth_names(&self) -> Vec<String> {
        let term = |t: &lambdak::material::OgdenTerm| format!("{} kPa, {}", t.mu_kpa, t.alpha);
        self.truths.iter().map(|m| m.terms.iter().map(term).collect::<Vec<_>>().join("; ")).collect()
    }
}

/// Runs and prints one way with all samples: the mean number of scans, and how many intervals hold the truth.
fn row(name: &str, samples: &[Sample], way: &Way, draws: u64, seed: u64) -> Result<(f64, [usize; 2]), Failure> {
    let mut total = Tally::default();
    let mut means = Vec::new();
    for sample in samples {
        let all: Vec<Campaign> = (0..draws)
            .into_par_iter()
            .map(|campaign| sample.campaign(way, seed, campaign))
            .collect::<Result<_, _>>()?;
        let num_scans: usize = all.iter().map(|c| c.num_scans).sum();
        means.push(format!("{:.2}", num_scans as f64 / draws as f64));
        total.num_campaigns += all.len();
        total.num_scans += num_scans;
        total.reached += all.iter().filter(|c| c.is_precise).count();
        (0..2).for_each(|n| total.covered[n] += all.iter().map(|c| c.covered[n]).sum::<usize>());
        total.sum_of_squares += all.iter().map(|c| c.sum_of_squares).sum::<f64>();
    }
    let mean = total.num_scans as f64 / total.num_campaigns as f64;
    let Tally { num_campaigns, reached, covered, .. } = total;
    let scans = means.join(" | ");
    let rms = (total.sum_of_squares / covered[1] as f64).sqrt();
    println!(
        "| {name} | {scans} | {mean:.2} | {reached} of {num_campaigns} | {} of {} | {rms:.2} |",
        covered[0], covered[1]
    );
    Ok((mean, covered))
}
