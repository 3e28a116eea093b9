//! `lambdak uniaxial`: the traditional route.

use super::curve_input::{ColumnArguments, FitArguments, read_curve};
use super::curve_tables::{fit_table, sequence_table};
use super::error::CliError;
use super::solve::solve_error;
use super::{Common, input, interrupt, output};
use crate::fem::PrepareError;
use crate::homogeneous::{
    Curve, CurveFit, CurveFitSequence, DumbbellError, DumbbellFit, DumbbellOptions, HomogeneousTest, fit_curves,
    fit_dumbbell,
};
use crate::provenance::{VERSION, input_hash};
use crate::report::fit_picture;
use crate::specimen::Specimen;
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};

#[derive(Args)]
pub(super) struct UniaxialArguments {
    /// Curve (CSV): stretch or strain and nominal stress; or grip displacement and force of a dumb-bell.
    curve: PathBuf,
    /// Dumb-bell specimen (specimen/1) that displacements belong to [default: ISO 37 type 4].
    #[arg(long)]
    specimen: Option<PathBuf>,
    /// Element size of the dumb-bell's mesh: search, standard, fine, or a factor.
    #[arg(long, default_value = "search")]
    mesh: String,
    #[command(flatten)]
    columns: ColumnArguments,
    #[command(flatten)]
    fit: FitArguments,
    #[command(flatten)]
    common: Common,
}

/// Result of `lambdak uniaxial` (`uniaxial/1`): the fields of `calibration/1` for the chosen fit, and all fits.
#[derive(Serialize)]
struct UniaxialResult<'a> {
    schema: &'static str,
    version: &'static str,
    input_hash: String,
    num_terms: usize,
    parameters: &'a [crate::homogeneous::CurveParameter],
    initial_shear_modulus_kpa: crate::homogeneous::Interval,
    chi2_per_datum: f64,
    fits: &'a [CurveFitSequence],
    conversion: Option<&'a DumbbellFit>,
}

pub(super) fn run(a: &UniaxialArguments) -> Result<(), CliError> {
    super::start_threads(&a.common)?;
    let csv = read_curve(&a.curve, HomogeneousTest::Uniaxial, &a.columns.options()?)?;
    let bad = |message: String| CliError::Input { path: a.curve.clone(), message };
    let (families, curve, conversion) = if csv.is_displacement {
        if !csv.is_force {
            let message = "displacements of a dumb-bell come with forces in N; give --length for plain strips";
            return Err(bad(message.into()));
        }
        let specimen = specimen_of(a.specimen.as_deref())?;
        let mesh = input::mesh_options(&a.mesh, &specimen, true)?;
        let mut sequences = Vec::new();
        let mut first: Option<DumbbellFit> = None;
        for neo_hookean in [false, true] {
            if !a.common.json {
                eprintln!(
                    "converting grips to gauge and fitting{}",
                    if neo_hookean { ", neo-Hookean term held" } else { "" }
                );
            }
            let options = DumbbellOptions { mesh, fit: a.fit.options(neo_hookean), max_rounds: 12, tolerance: 1e-4 };
            let found = fit_dumbbell(&specimen, &csv.drive, &csv.stress, &options, &interrupt::is_requested)
                .map_err(|e| dumbbell_error(&a.curve, e))?;
            sequences.push(found.sequence.clone());
            first.get_or_insert(found);
        }
        let Some(found) = first else { return Err(CliError::Numerics("no fit was made".into())) };
        let curve = Curve::new("uniaxial", HomogeneousTest::Uniaxial, &found.stretch, &found.nominal_stress_kpa)
            .map_err(|e| bad(e.to_string()))?;
        (sequences, curve, Some(found))
    } else {
        if csv.is_force {
            return Err(bad("the stress is a force; give --area, or a column of nominal stress".into()));
        }
        let curve = Curve::new("uniaxial", HomogeneousTest::Uniaxial, &csv.drive, &csv.stress)
            .map_err(|e| bad(e.to_string()))?;
        let sequences = [false, true]
            .iter()
            .map(|&nh| fit_curves(std::slice::from_ref(&curve), &a.fit.options(nh)).map_err(|e| bad(e.to_string())))
            .collect::<Result<Vec<_>, _>>()?;
        (sequences, curve, None)
    };
    let chosen = families[0].chosen();
    let result = UniaxialResult {
        schema: "uniaxial/1",
        version: VERSION,
        input_hash: input_hash(&serde_json::json!({
            "drive": csv.drive, "stress": csv.stress, "terms": a.fit.terms, "mesh": a.mesh
        })),
        num_terms: chosen.num_terms,
        parameters: &chosen.parameters,
        initial_shear_modulus_kpa: chosen.initial_shear_modulus_kpa,
        chi2_per_datum: chosen.chi2_per_datum,
        fits: &families,
        conversion: conversion.as_ref(),
    };
    if let Some(folder) = output::folder(a.common.out.as_deref(), a.common.json, &a.curve) {
        output::write_file(&folder, "uniaxial.json", output::to_json(&result)?.as_bytes())?;
        for (family, name) in families.iter().zip(["fits", "fits-neo-hookean"]) {
            let mut fits: Vec<&CurveFit> = vec![family.chosen()];
            fits.extend(family.fits.iter().filter(|f| f.num_terms != family.chosen().num_terms));
            let title = "Uniaxial curve: chosen fit (full) and the others (dashed)";
            let svg = fit_picture(title, &[(&curve, false)], &fits);
            output::write_file(&folder, &format!("{name}.svg"), svg.as_bytes())?;
        }
    }
    output::print(&if a.common.json {
        output::to_json(&result)?
    } else {
        summary(&a.curve, &families, conversion.as_ref())
    })
}

fn specimen_of(path: Option<&Path>) -> Result<Specimen, CliError> {
    match path {
        Some(path) => input::read_specimen(path),
        None => Specimen::from_json(include_str!("../../geometries/iso37-type4.json"))
            .map_err(|e| CliError::Numerics(e.to_string())),
    }
}

fn dumbbell_error(path: &Path, error: DumbbellError) -> CliError {
    match error {
        DumbbellError::Solve(e) | DumbbellError::Prepare(PrepareError::Solve(e)) => solve_error(e),
        other => CliError::Input { path: path.into(), message: other.to_string() },
    }
}

fn summary(path: &Path, families: &[CurveFitSequence], conversion: Option<&DumbbellFit>) -> String {
    let mut text = format!("{}\n", path.display());
    if let Some(c) = conversion {
        text += &format!(
            "\ngrip to gauge by finite elements: {} rounds, last change {:.1e} of the largest strain, finite element force \
             within {:.2} % of the data\n  displacement mm   gauge stretch     force N\n",
            c.num_rounds,
            c.last_change,
            100.0 * c.force_mismatch
        );
        for p in &c.conversion {
            text += &format!("  {:>15.3} {:>15.4} {:>11.4}\n", p.displacement_mm, p.gauge_stretch, p.force_n);
        }
    }
    for family in families {
        text += if family.neo_hookean { "\nwith a neo-Hookean term (alpha = 2 held)\n" } else { "\nfree terms\n" };
        text += &sequence_table(family);
        text += &fit_table(family.chosen());
    }
    text
}
