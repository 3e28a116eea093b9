//! `lambdak calibrate`.

use super::error::CliError;
use super::{Common, input, interrupt, output};
use crate::calibration::{
    CalibrateOptions, Calibration, CalibrationError, CalibrationResult, ContourOptions, Objective, Observed, Rule,
    TermCount, calibrate,
};
use crate::mesh::MeshOptions;
use crate::provenance::input_hash;
use crate::recording::{ReadLimits, Recording};
use crate::report::calibration_report;
use crate::specimen::Specimen;
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

/// Standard deviation of a force whose recording does not state one, N.
const FORCE_SD_N: f64 = 0.02;

#[derive(Clone, Copy, ValueEnum)]
enum ObjectiveName {
    Weighted,
    Paper,
}

#[derive(Clone, Copy, ValueEnum)]
enum RuleName {
    Bic,
    FTest,
    Decrement,
}

#[derive(Args)]
pub(super) struct CalibrateArguments {
    /// Folders of recordings (mru-recording/1); all are fitted together.
    #[arg(required = true, value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
    /// Number of Ogden terms, 1 to 5, or auto.
    #[arg(long, default_value = "auto")]
    terms: String,
    /// Rule that decides the number of terms.
    #[arg(long, value_enum, default_value = "bic")]
    rule: RuleName,
    /// Smallest decrement of the paper's loss that keeps a term.
    #[arg(long, default_value_t = crate::calibration::DECREMENT_THRESHOLD)]
    decrement: f64,
    /// What is minimised: chi-square by the noise, or the paper's loss.
    #[arg(long, value_enum, default_value = "weighted")]
    objective: ObjectiveName,
    /// Weight of the force in the paper's loss.
    #[arg(long, default_value_t = crate::calibration::PAPER_BETA)]
    beta: f64,
    /// Element size: search, standard, fine, or a factor on standard (0.2 to 5).
    #[arg(long, default_value = "standard")]
    mesh: String,
    /// Fit on this mesh alone, without an allowance for its error.
    #[arg(long)]
    one_mesh: bool,
    /// Starts tried for every number of terms.
    #[arg(long, default_value_t = 3)]
    starts: usize,
    /// Leave out voxels nearer than this to the ends of a sheared block, mm.
    #[arg(long, default_value_t = 0.0)]
    end_margin: f64,
    /// Profile likelihoods of all parameters.
    #[arg(long)]
    profile: bool,
    /// Contours of the losses around the estimate.
    #[arg(long)]
    contours: bool,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(a: &CalibrateArguments) -> Result<(), CliError> {
    super::start_threads(&a.common)?;
    let objective = match a.objective {
        ObjectiveName::Weighted => Objective::Weighted,
        ObjectiveName::Paper if a.beta >= 0.0 && a.beta.is_finite() => Objective::Paper { beta: a.beta },
        ObjectiveName::Paper => {
            return Err(CliError::Option { option: "beta", message: format!("{} is not a weight", a.beta) });
        }
    };
    let terms = match a.terms.as_str() {
        "auto" => TermCount::Auto { max: 3 },
        other => match other.parse() {
            Ok(n) if (1..=5).contains(&n) => TermCount::Fixed(n),
            _ => {
                return Err(CliError::Option {
                    option: "terms",
                    message: format!("'{other}' is neither auto nor a number from 1 to 5"),
                });
            }
        },
    };
    let mut observed = Vec::new();
    let mut names = Vec::new();
    for path in &a.recordings {
        let fail = |message: String| CliError::Input { path: path.clone(), message };
        let recording = Recording::read(path, &ReadLimits::default()).map_err(|e| fail(e.to_string()))?;
        let mut prepared = Observed::new(&recording, FORCE_SD_N).map_err(|e| fail(e.to_string()))?;
        if a.end_margin > 0.0 && prepared.leave_out_ends(a.end_margin) == 0 {
            return Err(CliError::Option {
                option: "end-margin",
                message: format!("{} mm leaves no voxel", a.end_margin),
            });
        }
        observed.push(prepared);
        names.push(recording.id.clone());
    }
    let options = CalibrateOptions {
        terms,
        objective,
        rule: match a.rule {
            RuleName::Bic => Rule::Bic,
            RuleName::FTest => Rule::FTest,
            RuleName::Decrement => Rule::Decrement,
        },
        decrement_threshold: a.decrement,
        mesh_factor: input::mesh_factor(&a.mesh)?,
        has_mesh_allowance: !a.one_mesh,
        num_starts: a.starts.clamp(1, 20),
        has_profiles: a.profile,
        contours: a.contours.then(|| ContourOptions { beta: a.beta, ..ContourOptions::default() }),
        ..CalibrateOptions::default()
    };
    let is_quiet = a.common.json;
    let on_stage = |stage: &str| {
        if !is_quiet {
            eprintln!("{stage}");
        }
    };
    let mesh = |s: &Specimen, factor: f64| MeshOptions::scaled(s, factor);
    let found =
        calibrate(&observed, &mesh, &options, &on_stage, &interrupt::is_requested).map_err(calibration_error)?;
    let hash = input_hash(&serde_json::json!({
        "recordings": observed.iter().map(|o| (&o.specimen, &o.noise_sd_mm, o.mask.num_voxels())).collect::<Vec<_>>(),
        "names": names,
        "settings": format!("{options:?}"),
    }));
    let result = CalibrationResult::new(&found, &observed, &names, objective, hash);
    if let Some(folder) = output::folder(a.common.out.as_deref(), a.common.json, &a.recordings[0]) {
        write_files(&folder, &found, &result, &observed)?;
    }
    output::print(&if a.common.json { output::to_json(&result)? } else { summary(&result) })
}

fn write_files(
    folder: &Path,
    found: &Calibration,
    result: &CalibrationResult,
    observed: &[Observed],
) -> Result<(), CliError> {
    output::write_file(folder, "calibration.json", output::to_json(result)?.as_bytes())?;
    output::write_file(folder, "material.json", result.material.to_json().as_bytes())?;
    let (pictures, report) = calibration_report(found, result, observed);
    for (name, svg) in pictures {
        output::write_file(folder, &format!("{name}.svg"), svg.as_bytes())?;
    }
    output::write_file(folder, "report.html", report.to_html().as_bytes())?;
    Ok(())
}

fn calibration_error(error: CalibrationError) -> CliError {
    if interrupt::is_requested() {
        return CliError::Interrupted("the calibration has no result yet".into());
    }
    CliError::Numerics(error.to_string())
}

/// The result as text.
fn summary(result: &CalibrationResult) -> String {
    let mut text = format!("{}\n\nnumber of terms\n", result.recordings.join(", "));
    text +=
        "  terms        chi2  chi2/datum   loss x 1000   mu (kPa)   F        p(F)      BIC change  decrement x 1000\n";
    for r in &result.term_selection.rows {
        let number = |v: Option<f64>, decimals: usize| v.map_or("-".to_string(), |v| format!("{v:.decimals$}"));
        text += &format!(
            "  {:<5} {:>11.1} {:>11.4} {:>13.4} {:>10.3}   {:<8} {:<9} {:<11} {}\n",
            r.num_terms,
            r.chi2,
            r.chi2_per_datum,
            1e3 * r.paper_loss,
            r.initial_shear_modulus_kpa,
            number(r.f_value, 2),
            r.f_p_value.map_or("-".to_string(), |p| format!("{p:.1e}")),
            number(r.bic_change, 1),
            number(r.decrement.map(|d| 1e3 * d), 4),
        );
        for d in &r.degeneracies {
            text += &format!("        {d}\n");
        }
    }
    let s = &result.term_selection;
    text += &format!(
        "  BIC takes {}, the F-test {}, the decrement {}; taken: {} ({})\n",
        s.by_bic, s.by_f_test, s.by_decrement, s.chosen, s.decided_by
    );
    text += "\nparameter            value           sd      95 % interval              mesh    misfit\n";
    let end = |v: Option<f64>| v.map_or("open".to_string(), |v| format!("{v:.5}"));
    for p in &result.parameters {
        let interval = format!("{} to {}", end(p.interval_95[0]), end(p.interval_95[1]));
        text += &match (p.value, p.sd) {
            (Some(value), Some(sd)) => {
                format!(
                    "  {:<10} {value:>13.5} {sd:>12.5}      {interval:<25} {:>8.5} {:>8.5}\n",
                    p.name, p.mesh_error, p.possible_shift
                )
            }
            _ => format!("  {:<10} not identifiable               {interval}\n", p.name),
        };
    }
    for r in &result.ratios {
        text += &format!("  {:<12} {:>11.4} ± {}\n", r.name, r.value, r.sd.map_or("?".into(), |s| format!("{s:.4}")));
    }
    if let Some(shear) = &result.initial_shear_modulus_kpa {
        let interval = shear.interval_95.map_or("open".into(), |[a, b]| format!("{a:.4} to {b:.4}"));
        text += &format!("  initial shear modulus {:.4} kPa, 95 % interval {interval}\n", shear.value);
    }
    text += &format!(
        "\nchi2 per datum {:.4}; paper's loss {:.4e} = loss_u {:.4e} + {:e} loss_F {}\n",
        result.chi2_per_datum,
        result.objective.paper_loss,
        result.loss_u,
        result.objective.beta,
        result.loss_f.map_or("(no force)".into(), |l| format!("{l:.4e}"))
    );
    for s in &result.steps {
        text += &format!(
            "  {} {} mm: {} voxels, misfit x, y, z {:.4} {:.4} {:.4} mm{}\n",
            s.recording,
            s.drive_mm,
            s.num_voxels,
            s.rms_mm[0],
            s.rms_mm[1],
            s.rms_mm[2],
            match (s.force_n, s.model_force_n) {
                (Some(f), Some(m)) => format!(", force {f:.4} N, model {m:.4} N"),
                _ => String::new(),
            }
        );
    }
    for note in &result.notes {
        text += &format!("note: {note}\n");
    }
    text
}
