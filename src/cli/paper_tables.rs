//! `lambdak paper-tables`.

use super::error::CliError;
use super::{Common, input, interrupt, output};
use crate::calibration::{Contour, Objective, PAPER_BETA, StandIn, StandInOptions, stand_ins};
use crate::homogeneous::{UniaxialStandIn, UniaxialStandInOptions, uniaxial_stand_in};
use crate::recording::Filter;
use crate::report::{ContourPlot, contour_panels};
use crate::sensitivity::{PartialVoxels, ScanSettings};
use crate::specimen::Specimen;
use clap::Args;
use std::path::PathBuf;

#[derive(Args)]
pub(super) struct PaperTablesArguments {
    /// Noise of the raw displacement in mm, one standard deviation: one number or x,y,z.
    #[arg(long, default_value = "0.05")]
    noise: String,
    /// Noise of the load cell in N, one standard deviation.
    #[arg(long, default_value_t = 0.02)]
    force_sd: f64,
    /// Noise of the dumb-bell's load cell relative to its largest force, one standard deviation.
    #[arg(long, default_value_t = 2e-3)]
    dumbbell_noise: f64,
    /// Element size of the fits relative to standard.
    #[arg(long, default_value_t = 1.4)]
    mesh: f64,
    /// Seed of the noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Weight of the force in the loss.
    #[arg(long, default_value_t = PAPER_BETA)]
    beta: f64,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(a: &PaperTablesArguments) -> Result<(), CliError> {
    super::start_threads(&a.common)?;
    let text = include_str!("../../geometries/two-hole-shear.json");
    let specimen = Specimen::from_json(text).map_err(|e| CliError::Numerics(e.to_string()))?;
    let truth = input::read_material(None)?;
    if !(0.2..=5.0).contains(&a.mesh) {
        return Err(CliError::Option { option: "mesh", message: format!("{} is not from 0.2 to 5", a.mesh) });
    }
    if !(0.0..=0.5).contains(&a.dumbbell_noise) {
        let message = format!("{} is not from 0 to 0.5", a.dumbbell_noise);
        return Err(CliError::Option { option: "dumbbell-noise", message });
    }
    let options = StandInOptions {
        truth_factor: 0.75 * a.mesh,
        fit_factor: a.mesh,
        scan: ScanSettings {
            voxel_mm: [1.0, 0.1875, 0.75],
            noise_sd_mm: input::triple("noise", &a.noise)?,
            force_sd_n: a.force_sd,
            partial_voxels: PartialVoxels::default(),
        },
        seed: a.seed,
        objective: Objective::Paper { beta: a.beta },
    };
    let is_quiet = a.common.json;
    let on_stage = |stage: &str| {
        if !is_quiet {
            eprintln!("{stage}");
        }
    };
    let (all, contours) = stand_ins(&specimen, &truth, &options, &on_stage, &interrupt::is_requested)
        .map_err(|e| CliError::Numerics(e.to_string()))?;
    on_stage("dumb-bell");
    let dumbbell = Specimen::from_json(include_str!("../../geometries/iso37-type4.json"))
        .map_err(|e| CliError::Numerics(e.to_string()))?;
    let uniaxial = UniaxialStandInOptions {
        truth_factor: 0.75 * a.mesh,
        fit_factor: a.mesh,
        relative_noise: a.dumbbell_noise,
        seed: a.seed,
    };
    let uniaxial = uniaxial_stand_in(&dumbbell, &uniaxial, &interrupt::is_requested)
        .map_err(|e| CliError::Numerics(e.to_string()))?;
    let name = PathBuf::from("paper-tables");
    if let Some(folder) = output::folder(a.common.out.as_deref(), a.common.json, &name) {
        // The one-term fit stands in the middle of every axis.
        let middle = |name: &str| {
            let axis = |c: &Contour| c.parameters.iter().position(|p| p == name).map(|a| c.values[a].clone());
            contours.iter().find_map(axis).and_then(|values| values.get(values.len() / 2).copied())
        };
        let picture = ContourPlot { panels: contour_panels(&contours, &middle) }.to_svg();
        output::write_file(&folder, "contours.svg", picture.as_bytes())?;
    }
    if a.common.json {
        let rows: Vec<_> = all
            .iter()
            .map(|s| {
                serde_json::json!({ "drive_mm": s.drive_mm, "filter": s.filter, "term_selection": s.calibration.selection })
            })
            .collect();
        let result = serde_json::json!({ "schema": "paper-tables/1", "uniaxial": uniaxial, "stand_ins": rows, "contours": contours });
        return output::print(&output::to_json(&result)?);
    }
    output::print(&(uniaxial_table(&uniaxial) + &tables(&all)))
}

/// A table like the paper's 1.
fn uniaxial_table(found: &UniaxialStandIn) -> String {
    let mut text = format!(
        "like Table 1: fits of a dumb-bell's curve (moduli in kPa; truth mu {:.2}; gauge stretches within {:.3})\n  stretch  terms  mu       terms (mu, alpha)                                              relative squares\n",
        found.true_initial_shear_modulus_kpa, found.stretch_error
    );
    for row in &found.rows {
        let terms: Vec<String> = row
            .fit
            .parameters
            .chunks(2)
            .map(|t| format!("({:.3e}, {:.2}{})", t[0].value, t[1].value, if t[1].held { " held" } else { "" }))
            .collect();
        text += &format!(
            "  1-{:<6} {:<6} {:<8.2} {:<62} {:.1e}\n",
            row.largest_stretch,
            row.fit.num_terms,
            row.fit.initial_shear_modulus_kpa.value,
            terms.join(" "),
            row.relative_squares
        );
    }
    text + "\n"
}

/// Tables like the paper's 2 and 3.
fn tables(all: &[StandIn]) -> String {
    let mut text = String::from(
        "like Table 2: fits by l_u + beta l_F (moduli in kPa)\n  drive  filter  kappa        mu       terms (mu, alpha)                                   l x 1000   decrement x 1000\n",
    );
    for s in all {
        for row in &s.calibration.selection.rows {
            let terms: Vec<String> = row.values[1..].chunks(2).map(|t| format!("({:.3}, {:.2})", t[0], t[1])).collect();
            text += &format!(
                "  {:<6} {:<7} {:<12.0} {:<8.3} {:<51} {:<10.4} {}\n",
                s.drive_mm,
                if s.filter == Filter::None { "N" } else { "Y" },
                row.values[0],
                row.initial_shear_modulus_kpa,
                terms.join(" "),
                1e3 * row.paper_loss,
                row.decrement.map_or("".into(), |d| format!("{:.4}", 1e3 * d))
            );
        }
    }
    text += "\nlike Table 3: means over drives and numbers of terms (kPa)\n  filter  kappa                    mu                  Poisson's ratio\n";
    for filter in [Filter::None, Filter::Hamming2] {
        let rows = || all.iter().filter(|s| s.filter == filter).flat_map(|s| &s.calibration.selection.rows);
        let statistics = |values: Vec<f64>| {
            let n = values.len().max(1) as f64;
            let mean = values.iter().sum::<f64>() / n;
            (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0)).sqrt())
        };
        let (kappa, kappa_sd) = statistics(rows().map(|r| r.values[0]).collect());
        let (mu, mu_sd) = statistics(rows().map(|r| r.initial_shear_modulus_kpa).collect());
        let ratio = |k: f64, g: f64| (3.0 * k - 2.0 * g) / (2.0 * (3.0 * k + g));
        text += &format!(
            "  {:<7} {kappa:>8.1} ± {kappa_sd:<12.1} {mu:>7.3} ± {mu_sd:<9.3} {:.4}\n",
            if filter == Filter::None { "N" } else { "Y" },
            ratio(kappa, mu)
        );
    }
    text
}
