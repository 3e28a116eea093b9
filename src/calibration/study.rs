//! Calibrations of many noisy scans of one truth: do the intervals cover, is the spread the promised one, is the number
//! of terms found?
//!
//! The truth is solved on another mesh than the one fitted on. What that mesh shifts is told apart from the noise by a
//! fit to the noiseless scan: coverage by the noise's intervals is that of the truth plus this shift, coverage by the
//! whole intervals, which allow for discretisation, that of the truth itself. Whether a term can be found at all is
//! said by the increase δ of χ² of the best model with a term less on the noiseless scan: the decrease seen in a draw
//! is then distributed as noncentral χ² with two degrees of freedom, and BIC asks for 2 ln n.
//!
//! A model's prediction does not depend on the noise: fits of a draw start from the optimum of the noiseless scan,
//! whose equilibria and derivatives all draws share. The first draws are also fitted from blind starts, which must end
//! in the same optimum.

use super::allowance::{Allowance, MESH_RATIO};
use super::calibrate::is_identifiable;
use super::calibrate_options::CalibrateOptions;
use super::error::CalibrationError;
use super::interval::widened;
use super::observed::Observed;
use super::problem::CalibrationProblem;
use super::recording_fit::RecordingFit;
use super::run::{Run, with_falling_exponents};
use super::starts::Candidates;
use super::synthetic::SyntheticScan;
use super::terms::{Rule, choose, compare};
use super::weak_intervals::{Ends, ends_by_noise};
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::recording::Filter;
use crate::sensitivity::{Protocol, ScanSettings};
use crate::specimen::Specimen;
use rayon::prelude::*;
use std::fmt;

/// A truth and how it is scanned.
#[derive(Clone, Debug)]
pub struct StudyCase {
    /// With its drives.
    pub specimen: Specimen,
    /// What made the data.
    pub truth: Material,
    /// Voxels and noise.
    pub scan: ScanSettings,
    /// Filter of the recordings.
    pub filter: Filter,
    /// Mesh of the truth.
    pub truth_mesh: MeshOptions,
    /// Mesh of the fits: its settings for an element size relative to that of the fits.
    pub fit_mesh: fn(&Specimen, f64) -> MeshOptions,
    /// Draws of noise.
    pub draws: usize,
    /// Draws that are fitted from blind starts too.
    pub blind_draws: usize,
    /// Seed of the noise.
    pub seed: u64,
    /// Settings of the fits; profiles, contours and the mesh's factor are not used.
    pub options: CalibrateOptions,
}

/// One parameter over all draws with as many terms as the truth.
#[derive(Clone, Debug)]
pub struct StudyRow {
    /// `kappa`, `mu_1`, …; terms in the order of falling exponents.
    pub parameter: String,
    /// What made the data.
    pub truth: f64,
    /// Shift by the mesh: the estimate from the noiseless scan minus the truth.
    pub mesh_shift: f64,
    /// Whether the noise leaves the noiseless estimate a standard deviation below half of its value.
    pub is_identifiable: bool,
    /// Mean of the estimates minus the noiseless estimate.
    pub mean_shift: f64,
    /// Standard deviation of the estimates.
    pub found_sd: f64,
    /// Mean of the standard deviations stated by the fits; NaN where none is.
    pub promised_sd: f64,
    /// Part of the draws whose 95 % interval holds the truth plus the mesh's shift; NaN where no interval is stated.
    pub coverage: f64,
    /// Standard deviation allowed for discretisation errors.
    pub discretisation_sd: f64,
    /// Part of the draws whose whole 95 % interval holds the truth.
    pub coverage_of_truth: f64,
}

/// All draws.
#[derive(Clone, Debug)]
pub struct Study {
    /// Per parameter.
    pub rows: Vec<StudyRow>,
    /// Draws that gave an estimate with as many terms as the truth.
    pub num_fitted: usize,
    /// Draws.
    pub num_draws: usize,
    /// Draws fitted from blind starts too, and those that ended in the same optimum.
    pub num_blind: [usize; 2],
    /// Draws for which a rule took 1, 2, 3, … terms: BIC, F-test, decrement.
    pub num_by_rule: [Vec<usize>; 3],
    /// Expected χ² decrease by the last term of the truth; none for one term.
    pub expected_decrease: Option<f64>,
    /// What BIC asks for.
    pub needed_decrease: f64,
    /// Probability that BIC keeps the last term of the truth.
    pub detection_probability: Option<f64>,
    /// χ² decrease that a term more than the truth's promises on the noiseless scan: the meshes' doing.
    pub spurious_decrease: f64,
    /// Mean of χ² per datum.
    pub chi2_per_datum: f64,
    /// Standard deviation of χ² per datum over the draws.
    pub chi2_sd: f64,
}

impl fmt::Display for Study {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} of {} draws fitted, {} of {} blind ones alike, chi2 per datum {:.4} ± {:.4}",
            self.num_fitted, self.num_draws, self.num_blind[1], self.num_blind[0], self.chi2_per_datum, self.chi2_sd
        )?;
        writeln!(
            f,
            "  parameter      truth  mesh shift  mean shift    found sd   promised sd  ratio  covered   mesh sd  truth covered"
        )?;
        for r in &self.rows {
            writeln!(
                f,
                "  {:<8} {:>11.4} {:>+11.4} {:>+11.4} {:>11.4} {:>13.4}  {:.3}  {:>5.1} % {:>9.4}  {:>5.1} %",
                r.parameter,
                r.truth,
                r.mesh_shift,
                r.mean_shift,
                r.found_sd,
                r.promised_sd,
                r.found_sd / r.promised_sd,
                100.0 * r.coverage,
                r.discretisation_sd,
                100.0 * r.coverage_of_truth
            )?;
        }
        let [bic, f_test, decrement] = &self.num_by_rule;
        writeln!(
            f,
            "  draws with 1, 2, … terms: BIC {bic:?}, F-test {f_test:?}, decrement {decrement:?}; the meshes promise {:.1} to \
             a term more",
            self.spurious_decrease
        )?;
        if let (Some(expected), Some(probability)) = (self.expected_decrease, self.detection_probability) {
            writeln!(
                f,
                "  the last term lowers chi2 by {expected:.1} (BIC asks for {:.1}): found in {:.1} % of draws by theory",
                self.needed_decrease,
                100.0 * probability
            )?;
        }
        Ok(())
    }
}

/// What a fit says of every parameter, and its χ² per datum.
struct DrawFit {
    values: Vec<f64>,
    sd: Vec<Option<f64>>,
    /// What the noise leaves.
    ends: Vec<Option<Ends>>,
    chi2_per_datum: f64,
}

struct Draw {
    /// The fit with as many terms as the truth.
    fit: Option<DrawFit>,
    chosen: [usize; 3],
    /// Whether a blind start found the same optimum, where one was tried.
    is_alike: Option<bool>,
}

/// What all draws start from.
struct Reference {
    /// Of the noiseless scan, with 1, 2, … terms.
    fits: Vec<RecordingFit>,
    /// A term more than the truth's.
    candidates: Candidates,
}

/// Runs the draws in parallel; the result does not depend on the number of threads.
///
/// # Errors
/// [`CalibrationError`] where the truth or the noiseless scan cannot be fitted, or the work was cancelled.
pub fn study(
    case: &StudyCase,
    on_draw: &(dyn Fn() + Sync),
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Study, CalibrationError> {
    let stop = || is_cancelled();
    let solve = &case.options.fit.solve;
    let synthetic = SyntheticScan::new(
        &case.specimen,
        &case.truth,
        &case.scan,
        &Protocol::default(),
        &case.truth_mesh,
        solve,
        &stop,
    )?;
    let observe = |data: &super::Measurement| -> Result<[Observed; 1], CalibrationError> {
        let recording = synthetic.recording("draw", &case.specimen, data, case.filter)?;
        Ok([Observed::new(&recording, case.scan.force_sd_n)?])
    };
    let truth = with_falling_exponents(&case.truth);
    let num_terms = truth.terms.len();
    let clean = observe(synthetic.noiseless())?;
    let new_problem = |factor: f64| -> Result<CalibrationProblem<'_>, CalibrationError> {
        CalibrationProblem::new(&clean, &|s| (case.fit_mesh)(s, factor), case.options.objective)
    };
    let problem = new_problem(1.0)?;
    let noiseless = problem.fit(&truth, None, &case.options.fit, &stop)?;
    let coarse = new_problem(MESH_RATIO)?.fit(&truth, None, &case.options.fit, &stop)?;
    let needed_decrease = 2.0 * (noiseless.num_data as f64).ln();
    let mut fits = Vec::new();
    if num_terms > 1 {
        let silent = |_: &str| {};
        let fewer = CalibrateOptions { terms: super::TermCount::Fixed(num_terms - 1), ..case.options };
        fits = Run::new(&fewer, true, &silent, &stop).select(&problem)?.1;
    }
    let expected_decrease = fits.last().map(|f| (f.chi2 - noiseless.chi2).max(0.0));
    let candidates = Candidates::new(&problem, &noiseless, &case.options.fit, &stop)?;
    let spurious_decrease = candidates.ranked(&problem.targets()?, 1).first().map_or(0.0, |(gain, _)| *gain);
    fits.push(noiseless.clone());
    let reference = Reference { fits, candidates };
    let chunk = case.draws.div_ceil(rayon::current_num_threads().max(1)).max(1);
    let starts: Vec<usize> = (0..case.draws).step_by(chunk).collect();
    let problems: Vec<CalibrationProblem> = starts.iter().map(|_| new_problem(1.0)).collect::<Result<_, _>>()?;
    let draws: Vec<Vec<Draw>> = problems
        .into_par_iter()
        .zip(starts)
        .map(|(mut problem, first)| {
            let mut done = Vec::new();
            for draw in first..(first + chunk).min(case.draws) {
                let data = observe(&synthetic.draw(case.seed, draw as u64))?;
                let present = problem.with_data(&data)?;
                let is_blind = draw < case.blind_draws;
                done.push(one_draw(&present, case, &reference, is_blind, is_cancelled)?);
                problem = present.with_data(&clean)?;
                on_draw();
            }
            Ok(done)
        })
        .collect::<Result<_, CalibrationError>>()?;
    let draws: Vec<Draw> = draws.into_iter().flatten().collect();
    let allowance = Allowance::new(&noiseless, &coarse, &problem.targets()?, case.options.discretisation_factor);
    let mut found = summarise(&draws, &truth, &noiseless, &coarse.material, &allowance);
    found.expected_decrease = expected_decrease;
    found.needed_decrease = needed_decrease;
    found.detection_probability = expected_decrease.map(|d| detection_probability(d, needed_decrease));
    found.spurious_decrease = spurious_decrease;
    Ok(found)
}

fn one_draw(
    problem: &CalibrationProblem,
    case: &StudyCase,
    reference: &Reference,
    is_blind: bool,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Draw, CalibrationError> {
    let silent = |_: &str| {};
    let mut run = Run::new(&case.options, true, &silent, is_cancelled);
    let (mut rows, mut fits) = (Vec::new(), Vec::new());
    for from in &reference.fits {
        let fit = match problem.fit_from(from, &case.options.fit, is_cancelled) {
            Err(e) if e.is_of_the_data() => return Ok(Draw { fit: None, chosen: [0; 3], is_alike: None }),
            other => other?,
        };
        rows.push(run.row(problem, &fit, 1, 1)?);
        fits.push(fit);
    }
    let num_terms = fits.len();
    let starts = reference.candidates.ranked(&problem.targets()?, case.options.num_starts);
    let starts: Vec<Material> =
        starts.into_iter().filter(|(promise, _)| *promise >= case.options.least_promise).map(|(_, s)| s).collect();
    if let Some((row, _)) = run.best_of(problem, &starts, None)? {
        rows.push(row);
    }
    compare(&mut rows, fits[0].num_data);
    let chosen = [Rule::Bic, Rule::FTest, Rule::Decrement].map(|r| choose(&rows, r, case.options.decrement_threshold));
    let fit = fits.pop().filter(RecordingFit::is_settled);
    let mut is_alike = None;
    if is_blind {
        let blind = match run.select(problem) {
            Err(e) if e.is_of_the_data() => None,
            other => other?.1.get(num_terms - 1).map(|f| f.chi2),
        };
        // Both are within a small part of a standard deviation of the optimum.
        is_alike = Some(fit.as_ref().zip(blind).is_some_and(|(f, chi2)| (chi2 - f.chi2).abs() < 0.1));
    }
    let Some(fit) = fit else { return Ok(Draw { fit: None, chosen, is_alike }) };
    let parameters = fit.material.parameters();
    let fit = DrawFit {
        values: parameters.iter().map(|p| fit.material.value(*p)).collect(),
        sd: parameters.iter().map(|p| fit.sd(*p)).collect(),
        ends: ends_by_noise(problem, &fit, &case.options.fit, is_cancelled)?.ends,
        chi2_per_datum: fit.chi2_per_datum,
    };
    Ok(Draw { fit: Some(fit), chosen, is_alike })
}

fn summarise(
    draws: &[Draw],
    truth: &Material,
    noiseless: &RecordingFit,
    coarse: &Material,
    allowance: &Allowance,
) -> Study {
    let fitted: Vec<&DrawFit> = draws.iter().filter_map(|d| d.fit.as_ref()).collect();
    // 0/0 is the NaN that is meant.
    let mean = |values: &mut dyn Iterator<Item = f64>| {
        let (sum, count) = values.fold((0.0, 0.0), |(s, n), x| (s + x, n + 1.0));
        sum / count
    };
    let spread = |values: &[f64]| {
        let m = mean(&mut values.iter().copied());
        (values.iter().map(|v| (v - m).powi(2)).sum::<f64>() / (values.len() as f64 - 1.0)).sqrt()
    };
    let rows = truth
        .parameters()
        .into_iter()
        .enumerate()
        .map(|(i, parameter)| {
            let at = noiseless.material.value(parameter);
            let values: Vec<f64> = fitted.iter().map(|d| d.values[i]).collect();
            let stated = || fitted.iter().filter_map(|d| d.ends[i].map(|ends| (d.values[i], ends)));
            let discretisation_sd = allowance.factor * allowance.mesh_error_of(parameter, noiseless, coarse);
            let true_value = truth.value(parameter);
            let covers = |v: f64, center: f64, ends: Ends, discretisation_sd: f64| {
                let [low, high] = widened(parameter, v, ends, discretisation_sd, 0.0);
                f64::from(u8::from(low.is_none_or(|l| l <= center) && high.is_none_or(|h| center <= h)))
            };
            StudyRow {
                parameter: parameter.name(),
                truth: truth.value(parameter),
                mesh_shift: at - truth.value(parameter),
                is_identifiable: is_identifiable(noiseless, parameter),
                mean_shift: mean(&mut values.iter().copied()) - at,
                found_sd: spread(&values),
                promised_sd: mean(&mut fitted.iter().filter_map(|d| d.sd[i])),
                coverage: mean(&mut stated().map(|(v, ends)| covers(v, at, ends, 0.0))),
                discretisation_sd,
                coverage_of_truth: mean(&mut stated().map(|(v, ends)| covers(v, true_value, ends, discretisation_sd))),
            }
        })
        .collect();
    let most = draws.iter().flat_map(|d| d.chosen).max().unwrap_or(0);
    let num_by_rule =
        [0, 1, 2].map(|r| (1..=most).map(|n| draws.iter().filter(|d| d.chosen[r] == n).count()).collect());
    let chi2: Vec<f64> = fitted.iter().map(|d| d.chi2_per_datum).collect();
    Study {
        rows,
        num_fitted: fitted.len(),
        num_draws: draws.len(),
        num_by_rule,
        num_blind: [
            draws.iter().filter(|d| d.is_alike.is_some()).count(),
            draws.iter().filter(|d| d.is_alike == Some(true)).count(),
        ],
        expected_decrease: None,
        needed_decrease: f64::NAN,
        detection_probability: None,
        spurious_decrease: f64::NAN,
        chi2_per_datum: mean(&mut chi2.iter().copied()),
        chi2_sd: spread(&chi2),
    }
}

/// P(noncentral χ² with two degrees of freedom and noncentrality `expected` > `needed`), by Sankaran's normal
/// approximation.
fn detection_probability(expected: f64, needed: f64) -> f64 {
    let (k, l) = (2.0, expected);
    let h = 1.0 - 2.0 / 3.0 * (k + l) * (k + 3.0 * l) / (k + 2.0 * l).powi(2);
    let p = (k + 2.0 * l) / (k + l).powi(2);
    let m = (h - 1.0) * (1.0 - 3.0 * h);
    let mean = 1.0 + h * p * (h - 1.0 - 0.5 * (2.0 - h) * m * p);
    let sd = h * (2.0 * p).sqrt() * (1.0 + 0.5 * m * p);
    1.0 - normal_cdf(((needed / (k + l)).powf(h) - mean) / sd)
}

/// The standard normal distribution function (Abramowitz and Stegun 26.2.17, 7·10⁻⁸).
fn normal_cdf(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.231_641_9 * x.abs());
    let tail = (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt()
        * t
        * (0.319_381_530 + t * (-0.356_563_782 + t * (1.781_477_937 + t * (-1.821_255_978 + t * 1.330_274_429))));
    if x >= 0.0 { 1.0 - tail } else { tail }
}

#[cfg(test)]
#[path = "study_tests.rs"]
mod tests;
