//! `lambdak solve`.

use super::error::CliError;
use super::{Common, Subject, input, interrupt, output};
use crate::fem::{Equilibrium, ForwardModel, PrepareError, QuadraturePoint, SolveError, SolveOptions, SolveResult};
use crate::kinematics::decompose;
use crate::provenance::input_hash;
use crate::report::{ReportError, deformed_picture, vtu_of};
use clap::Args;

#[derive(Args)]
pub(super) struct SolveArguments {
    #[command(flatten)]
    subject: Subject,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(a: &SolveArguments) -> Result<(), CliError> {
    super::start_threads(&a.common)?;
    let mut specimen = input::read_specimen(&a.subject.specimen)?;
    let material = input::read_material(a.subject.material.as_deref())?;
    if !a.subject.drive.is_empty() {
        specimen.drive_mm.clone_from(&a.subject.drive);
        specimen.validate().map_err(|e| CliError::Option { option: "drive", message: e.to_string() })?;
    }
    let options = input::mesh_options(&a.subject.mesh, &specimen, !a.subject.full)?;
    let hash = input_hash(&serde_json::json!({ "specimen": specimen, "material": material, "mesh": options }));
    let mut model = ForwardModel::of_specimen(&specimen, &options).map_err(|e| prepare_error(&a.subject, e))?;
    let mut result = SolveResult::new(&model, hash);
    let folder = output::folder(a.common.out.as_deref(), a.common.json, &a.subject.specimen);
    let mut last: Option<Equilibrium> = None;
    for (index, &drive) in specimen.drive_mm.iter().enumerate() {
        if !a.common.json {
            eprintln!("solving drive {drive} mm ({} of {})", index + 1, specimen.drive_mm.len());
        }
        let found = model
            .solve(&material, drive, last.as_ref(), &SolveOptions::default(), &interrupt::is_requested)
            .map_err(solve_error)?;
        let fields = model.quadrature_fields(&material, &found);
        result.push(&found, extremes(&fields), model.statistics());
        last = Some(found);
    }
    if let (Some(folder), Some(state)) = (&folder, &last) {
        let report_error = |e: ReportError| CliError::Numerics(e.to_string());
        let vtu = vtu_of(&model, &material, state).map_err(report_error)?;
        output::write_file(folder, "solution.vtu", vtu.as_bytes())?;
        let picture = deformed_picture(&model, &material, state).map_err(report_error)?;
        output::write_file(folder, "deformed.svg", picture.as_bytes())?;
    }
    if let Some(folder) = &folder {
        output::write_file(folder, "solve.json", output::to_json(&result)?.as_bytes())?;
    }
    if a.common.json {
        return output::print(&output::to_json(&result)?);
    }
    let mut text = format!(
        "{}: {} elements, {} unknowns, smallest scaled Jacobian {:.2}\n\n  drive mm     force N   normal force N   largest stretch   det F\n",
        specimen.name, result.num_elements, result.num_unknowns, result.min_scaled_jacobian
    );
    for step in &result.steps {
        text += &format!(
            "{:>10.3} {:>11.4} {:>16.4} {:>17.3}   {:.3} to {:.3}\n",
            step.drive_mm,
            step.force_n,
            step.normal_force_n,
            step.largest_principal_stretch,
            step.jacobian_range[0],
            step.jacobian_range[1]
        );
    }
    if let Some(folder) = &folder {
        text += &format!("\nfiles: {}/solution.vtu (ParaView), deformed.svg, solve.json\n", folder.display());
    }
    output::print(&text)
}

/// Largest principal stretch, smallest and largest det F.
fn extremes(fields: &[QuadraturePoint]) -> [f64; 3] {
    fields.iter().fold([f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY], |[s, low, high], q| {
        let d = decompose(&q.deformation_gradient);
        [s.max(d.principal_stretches[0]), low.min(d.jacobian), high.max(d.jacobian)]
    })
}

pub(super) fn prepare_error(subject: &Subject, error: PrepareError) -> CliError {
    match error {
        PrepareError::Mesh(e) => CliError::Input { path: subject.specimen.clone(), message: e.to_string() },
        PrepareError::Solve(e) => solve_error(e),
    }
}

pub(super) fn solve_error(error: SolveError) -> CliError {
    match error {
        SolveError::Cancelled { .. } => CliError::Interrupted(error.to_string()),
        other => CliError::Numerics(other.to_string()),
    }
}
