//! How the diagnosis fares on concealed causes.

use super::conceal::{ConcealError, conceal};
use super::draw::{Hidden, HiddenCause, draw_cause};
use crate::diagnosis::{DiagnosisError, DiagnosisOptions, DiagnosisResult, Verdict, diagnose};
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};

/// A cause counts as detectable from a displacement of this many allowances (rms at the largest drive, the material unchanged)…
const DETECTABLE_ALLOWANCES: f64 = 3.0;
/// … or, where it acts on the force, from this relative change of it.
const DETECTABLE_FORCE: f64 = 0.02;

/// Settings of [`prove`].
#[derive(Clone, Debug)]
pub struct ProofOptions {
    /// Recordings per cause.
    pub per_cause: usize,
    /// Recordings without a cause.
    pub controls: usize,
    /// Recordings per cause that the diagnosis is not told of.
    pub unknown: usize,
    /// Seed of all draws.
    pub seed: u64,
    /// Element size of the diagnosis as a factor on the standard one.
    pub mesh_factor: f64,
    /// Causes hidden; all where empty.
    pub only: Vec<HiddenCause>,
}

/// One diagnosis of a concealed cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scored {
    /// What was hidden.
    pub hidden: Hidden,
    /// Whether the diagnosis knew of the cause.
    pub is_known: bool,
    /// The verdict; null where the diagnosis failed.
    pub verdict: Option<Verdict>,
    /// Causes named, first found first; of alternatives that cannot be told apart too, after them.
    pub named: Vec<String>,
    /// Change of the displacement by the cause at the largest drive, mm rms.
    pub effect_rms_mm: f64,
    /// Largest relative change of a force.
    pub effect_force_relative: f64,
    /// Whether theory says that it can be seen.
    pub is_detectable: bool,
    /// Whether it is right: the hidden cause first; none named where none is hidden; unexplained where not known.
    pub is_right: bool,
    /// Whether nothing was left unexplained.
    #[serde(default)]
    pub is_explained: bool,
    /// Distance from the place found to the hidden one, mm: of the cause, or of what is left where it is not known.
    pub location_error_mm: Option<f64>,
    /// Half the diagonal of the hidden place, mm.
    pub location_size_mm: Option<f64>,
    /// Parameters of the hidden cause: name, and estimate minus truth in half widths of the 95 % interval.
    pub deviations: Vec<(String, f64)>,
    /// χ² per datum before and after; null where there is no diagnosis.
    pub chi2: Option<[f64; 2]>,
    /// Why there is no diagnosis: it failed, or the recording could not be made.
    pub failure: Option<String>,
}

impl Scored {
    /// As long as nothing is known of the diagnosis.
    fn undiagnosed(hidden: &Hidden, is_known: bool) -> Scored {
        Scored {
            hidden: hidden.clone(),
            is_known,
            verdict: None,
            named: Vec::new(),
            effect_rms_mm: 0.0,
            effect_force_relative: 0.0,
            is_detectable: false,
            is_right: false,
            is_explained: false,
            location_error_mm: None,
            location_size_mm: None,
            deviations: Vec::new(),
            chi2: None,
            failure: None,
        }
    }
}

/// Sums over one hidden cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CauseSummary {
    /// The cause.
    pub cause: HiddenCause,
    /// Recordings, and those in which it is detectable.
    pub num_recordings: usize,
    /// Of these, detectable.
    pub num_detectable: usize,
    /// Right among all and among the detectable.
    pub num_right: usize,
    /// Right among the detectable.
    pub num_right_detectable: usize,
    /// Right with nothing left unexplained, of all.
    pub num_right_explained: usize,
    /// Nothing named.
    pub num_silent: usize,
    /// Median distance to the hidden place where named right, mm.
    pub median_location_error_mm: Option<f64>,
    /// Intervals that hold the truth, and all intervals, where named right.
    pub num_covered: [usize; 2],
    /// How often each cause was named first.
    pub first_named: Vec<(String, usize)>,
}

/// A proof.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Proof {
    /// `proof/1`.
    pub schema: String,
    /// Every diagnosis.
    pub scored: Vec<Scored>,
    /// Causes known to the diagnosis.
    pub known: Vec<CauseSummary>,
    /// Causes kept from it.
    pub unknown: Vec<CauseSummary>,
    /// Right among the detectable, causes together.
    pub right_of_detectable: f64,
    /// Controls in which a cause was named or left unexplained.
    pub false_alarm_rate: f64,
    /// Unknown detectable causes that were called unexplained.
    pub unexplained_of_unknown: f64,
    /// Share of intervals that hold the truth.
    pub interval_coverage: f64,
    /// Program version.
    pub version: String,
    /// The build (see [`crate::provenance::build_id`]).
    pub build: String,
    /// Hash of the settings.
    pub input_hash: String,
}

/// What to conceal: cause, seed and whether the diagnosis knows of it.
fn tasks(options: &ProofOptions) -> Vec<(HiddenCause, u64, bool)> {
    let mut all = Vec::new();
    // Round by round, so that a stopped proof has seen all causes alike.
    let rounds = options.per_cause.max(options.unknown).max(1);
    let unknown =
        [HiddenCause::Inclusion, HiddenCause::Debond, HiddenCause::Hole, HiddenCause::Gradient, HiddenCause::Tilt];
    for round in 0..rounds {
        let seed = |kind: u64| options.seed.wrapping_mul(1_000_003) + 1000 * round as u64 + kind;
        for n in 0..options.controls {
            if n * rounds / options.controls.max(1) == round {
                all.push((HiddenCause::None, options.seed.wrapping_mul(7_000_003) + n as u64, true));
            }
        }
        if round < options.per_cause {
            all.extend(HiddenCause::ALL.iter().enumerate().map(|(n, c)| (*c, seed(n as u64), true)));
        }
        if round < options.unknown {
            all.extend(unknown.iter().enumerate().map(|(n, c)| (*c, seed(500 + n as u64), false)));
        }
    }
    all.retain(|(cause, _, _)| options.only.is_empty() || options.only.contains(cause));
    all
}

/// Conceals and diagnoses all of `options`; `done` are results of an earlier, stopped run with the same options; `report` is told
/// of each result as it comes. A recording that cannot be made counts as one in which nothing was found,
/// and not as detectable: how large its effect is, is not known.
pub fn prove(
    specimen: &Specimen,
    options: &ProofOptions,
    done: &[Scored],
    report: &(dyn Fn(&Scored, usize, usize) + Sync),
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Proof {
    use rayon::prelude::*;
    let tasks = tasks(options);
    let scored: Vec<Option<Scored>> = tasks
        .par_iter()
        .enumerate()
        // One at a time per thread, in order.
        .with_max_len(1)
        .map(|(n, &(cause, seed, is_known))| {
            let same = |s: &&Scored| s.hidden.cause == cause && s.hidden.seed == seed && s.is_known == is_known;
            if let Some(found) = done.iter().find(same) {
                return Some(found.clone());
            }
            if is_cancelled() {
                return None;
            }
            let hidden = draw_cause(cause, seed);
            let found = score_one(specimen, &hidden, is_known, options.mesh_factor, is_cancelled)
                .unwrap_or_else(|e| Scored { failure: Some(e.to_string()), ..Scored::undiagnosed(&hidden, is_known) });
            if is_cancelled() {
                return None;
            }
            report(&found, n, tasks.len());
            Some(found)
        })
        .collect();
    sum_up(scored.into_iter().flatten().collect(), options)
}

/// Conceals and diagnoses one cause.
///
/// # Errors
/// [`ConcealError`] where its recording cannot be made; a diagnosis that fails is a result.
pub fn score_one(
    specimen: &Specimen,
    hidden: &Hidden,
    is_known: bool,
    mesh_factor: f64,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<Scored, ConcealError> {
    let made = conceal(specimen, hidden)?;
    let mut options = DiagnosisOptions { mesh_factor, ..DiagnosisOptions::default() };
    if !is_known {
        options.left_out.push(hidden.cause.name().into());
    }
    let found = diagnose(&made.recording, &options, &|_| {}, is_cancelled);
    Ok(scored(specimen, hidden, is_known, &made, found.as_ref().map(|d| DiagnosisResult::new(d, "", String::new()))))
}

fn scored(
    specimen: &Specimen,
    hidden: &Hidden,
    is_known: bool,
    made: &super::Concealed,
    found: Result<DiagnosisResult, &DiagnosisError>,
) -> Scored {
    let largest = specimen.drive_mm.iter().fold(0.0f64, |s, d| s.max(d.abs()));
    let acts_on_force = matches!(
        hidden.cause,
        HiddenCause::Relaxation | HiddenCause::Mullins | HiddenCause::Cell | HiddenCause::Compliance
    );
    let is_detectable = hidden.cause != HiddenCause::None
        && (made.effect_rms_mm > DETECTABLE_ALLOWANCES * 1e-3 * largest
            || acts_on_force && made.effect_force_relative > DETECTABLE_FORCE);
    let mut s = Scored {
        effect_rms_mm: made.effect_rms_mm,
        effect_force_relative: made.effect_force_relative,
        is_detectable,
        ..Scored::undiagnosed(hidden, is_known)
    };
    let result = match found {
        Ok(result) => result,
        Err(error) => {
            s.failure = Some(error.to_string());
            return s;
        }
    };
    s.verdict = Some(result.verdict);
    s.is_explained = result.verdict != Verdict::Unexplained;
    s.named = result.causes.iter().chain(&result.alternatives).map(|c| c.name.clone()).collect();
    s.chi2 = Some([result.chi2_per_datum.before, result.chi2_per_datum.after]);
    s.is_right = match (hidden.cause, is_known) {
        (HiddenCause::None, _) => result.verdict == Verdict::NoMismatch,
        (_, false) => result.verdict == Verdict::Unexplained,
        (cause, true) => result.causes.first().is_some_and(|c| c.name == cause.name()),
    };
    let place = match hidden.cause {
        HiddenCause::Inclusion | HiddenCause::Debond => Some((hidden.center_mm, hidden.extent_mm)),
        HiddenCause::Wrap => Some((hidden.center_mm, hidden.extent_mm)),
        HiddenCause::Hole => specimen.holes.get(hidden.which).map(|h| {
            let made = [0, 1].map(|a| h.center_mm[a] + hidden.strength * hidden.direction[1 + a]);
            ([made[0], 0.0, made[1]], [h.diameter_mm, specimen.block.thickness_mm, h.diameter_mm])
        }),
        _ => None,
    };
    let named = result.causes.first().filter(|c| c.name == hidden.cause.name());
    if let Some((center, extent)) = place {
        let at = if is_known { named.and_then(|c| c.location.clone()) } else { result.left_at.clone() };
        s.location_size_mm = Some(0.5 * extent.iter().map(|x| x * x).sum::<f64>().sqrt());
        s.location_error_mm = at.map(|l| (0..3).map(|a| (l.center_mm[a] - center[a]).powi(2)).sum::<f64>().sqrt());
    }
    if let Some(cause) = named.filter(|_| is_known) {
        let truths = truths(specimen, hidden);
        s.deviations = cause
            .parameters
            .iter()
            .filter_map(|p| {
                let (_, truth) = truths.iter().find(|(name, _)| *name == p.name)?;
                let [low, high] = p.interval_95?;
                Some((p.name.clone(), (0.5 * (low + high) - truth) / (0.5 * (high - low))))
            })
            .collect();
    }
    s
}

/// True values of the diagnosis' parameters, where both mean the same.
fn truths(specimen: &Specimen, h: &Hidden) -> Vec<(String, f64)> {
    let axis = |n: usize| ["x", "y", "z"][n];
    let only = |name: &str, axes: &[usize]| -> Vec<(String, f64)> {
        axes.iter().map(|&a| (format!("{name}{}", axis(a)), if a == h.which { h.strength } else { 0.0 })).collect()
    };
    let one = |name: &str| vec![(name.to_string(), h.strength)];
    match h.cause {
        HiddenCause::Gradient => only("relative_change_center_to_face_", &[0, 1, 2]),
        HiddenCause::Inclusion => {
            let mut all = one("log_stiffness_factor");
            all.extend((0..3).map(|a| (format!("center_{}_mm", axis(a)), h.center_mm[a])));
            all.push(("radius_mm".into(), 0.5 * h.extent_mm[0]));
            all
        }
        HiddenCause::Swelling => one("log_volume_ratio"),
        HiddenCause::Debond => {
            let half = [0.5 * specimen.block.length_mm, 0.0, 0.5 * specimen.block.width_mm];
            // Edges on the face's own boundary are no parameters.
            [0, 2]
                .into_iter()
                .flat_map(|a| {
                    let edges = [-0.5, 0.5].map(|s| h.center_mm[a] + s * h.extent_mm[a]);
                    [("low", edges[0]), ("high", edges[1])].map(|(n, e)| (format!("{n}_{}_mm", axis(a)), e, half[a]))
                })
                .filter(|(_, edge, half)| edge.abs() < half - 0.3)
                .map(|(name, edge, _)| (name, edge))
                .collect()
        }
        HiddenCause::Tilt => only("degrees_at_full_drive_about_", &[0, 1, 2]),
        HiddenCause::Offaxis => [1, 2]
            .map(|a| (format!("{}_mm_at_full_drive", axis(a)), if a == h.which { h.strength } else { 0.0 }))
            .to_vec(),
        HiddenCause::Compliance => one("mm_per_n"),
        HiddenCause::Cell => one("offset_n"),
        HiddenCause::Gain => only("relative_gain_error_", &[0, 1, 2]),
        HiddenCause::Hole => ["diameter_error_mm", "center_error_x_mm", "center_error_z_mm"]
            .into_iter()
            .zip(h.direction)
            .map(|(name, d)| (name.to_string(), h.strength * d))
            .collect(),
        HiddenCause::Fibre => {
            vec![(
                "modulus_kpa".into(),
                h.strength * h.material.terms.iter().map(|t| 0.5 * t.mu_kpa * t.alpha).sum::<f64>(),
            )]
        }
        HiddenCause::Wrap => one("jump_mm"),
        HiddenCause::Registration => {
            (0..3).map(|a| (format!("shift_{}_mm", axis(a)), if a == h.which { h.strength } else { 0.0 })).collect()
        }
        HiddenCause::Slack => one("slack_mm"),
        HiddenCause::Mount => ["y_mm", "z_mm", "degrees_about_x", "degrees_about_y", "degrees_about_z"]
            .into_iter()
            .enumerate()
            .map(|(n, name)| (name.to_string(), if n == h.which { h.strength } else { 0.0 }))
            .collect(),
        // A firm bond is the end of the range.
        HiddenCause::Bond => [(0, "fixed"), (1, "moved")]
            .into_iter()
            .filter(|(face, _)| h.which == *face || h.which == 2)
            .map(|(_, name)| (format!("{name}_plate_mm_per_kpa"), h.strength))
            .collect(),
        HiddenCause::Compressibility => one("bulk_over_shear_modulus"),
        _ => Vec::new(),
    }
}

fn sum_up(scored: Vec<Scored>, options: &ProofOptions) -> Proof {
    let summary = |cause: HiddenCause, is_known: bool| -> Option<CauseSummary> {
        let of: Vec<&Scored> = scored.iter().filter(|s| s.hidden.cause == cause && s.is_known == is_known).collect();
        if of.is_empty() {
            return None;
        }
        let count = |f: &dyn Fn(&Scored) -> bool| of.iter().filter(|s| f(s)).count();
        let mut errors: Vec<f64> = of.iter().filter(|s| s.is_right).filter_map(|s| s.location_error_mm).collect();
        errors.sort_by(f64::total_cmp);
        let covered: Vec<bool> =
            of.iter().filter(|s| s.is_right).flat_map(|s| s.deviations.iter().map(|d| d.1.abs() <= 1.0)).collect();
        let mut first_named: Vec<(String, usize)> = Vec::new();
        for s in &of {
            let silent = match s.verdict {
                Some(Verdict::Unexplained) => "(unexplained)",
                Some(_) => "(none)",
                None => "(failed)",
            };
            let name = s.named.first().map_or(silent, |n| n);
            match first_named.iter_mut().find(|(n, _)| n == name) {
                Some((_, k)) => *k += 1,
                None => first_named.push((name.into(), 1)),
            }
        }
        first_named.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
        Some(CauseSummary {
            cause,
            num_recordings: of.len(),
            num_detectable: count(&|s| s.is_detectable),
            num_right: count(&|s| s.is_right),
            num_right_detectable: count(&|s| s.is_right && s.is_detectable),
            num_right_explained: count(&|s| s.is_right && s.is_explained),
            num_silent: count(&|s| s.verdict == Some(Verdict::NoMismatch)),
            median_location_error_mm: errors.get(errors.len() / 2).copied(),
            num_covered: [covered.iter().filter(|c| **c).count(), covered.len()],
            first_named,
        })
    };
    let all = || std::iter::once(HiddenCause::None).chain(HiddenCause::ALL);
    let known: Vec<CauseSummary> = all().filter_map(|c| summary(c, true)).collect();
    let unknown: Vec<CauseSummary> = all().filter_map(|c| summary(c, false)).collect();
    let ratio = |a: usize, b: usize| if b == 0 { f64::NAN } else { a as f64 / b as f64 };
    let causes = || known.iter().filter(|k| k.cause != HiddenCause::None);
    let right = causes().map(|k| k.num_right_detectable).sum();
    let detectable = causes().map(|k| k.num_detectable).sum();
    let controls = known.iter().find(|k| k.cause == HiddenCause::None);
    let covered = causes().fold([0, 0], |s, k| [s[0] + k.num_covered[0], s[1] + k.num_covered[1]]);
    let inputs = serde_json::json!({
        "per_cause": options.per_cause, "controls": options.controls, "unknown": options.unknown, "seed": options.seed,
        "mesh_factor": options.mesh_factor, "only": options.only,
    });
    Proof {
        schema: "proof/1".into(),
        right_of_detectable: ratio(right, detectable),
        false_alarm_rate: controls.map_or(f64::NAN, |k| ratio(k.num_recordings - k.num_right, k.num_recordings)),
        unexplained_of_unknown: ratio(
            unknown.iter().map(|k| k.num_right_detectable).sum(),
            unknown.iter().map(|k| k.num_detectable).sum(),
        ),
        interval_coverage: ratio(covered[0], covered[1]),
        scored,
        known,
        unknown,
        version: crate::provenance::VERSION.into(),
        build: crate::provenance::build_id(),
        input_hash: crate::provenance::input_hash(&inputs),
    }
}
