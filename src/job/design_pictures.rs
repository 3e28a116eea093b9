//! The base and the best specimen once more, for the pictures that need fields.

use super::{JobError, Outcome};
use crate::design::{DesignResult, Study};
use crate::fem::ForwardModel;
use crate::mesh::MeshOptions;
use crate::report::{DesignPictures, deformed_picture, histogram_picture, surface_json};
use crate::sensitivity::{DriveSelection, EvaluationOptions, evaluate_model};

/// Histograms, deformed shapes, and the surfaces for the page, which are added to the outcome with the histogram.
///
/// # Errors
/// [`JobError::NoSolution`].
pub(super) fn pictures(
    study: &Study,
    result: &DesignResult,
    outcome: &mut Outcome,
) -> Result<DesignPictures, JobError> {
    let failed = |e: &dyn std::fmt::Display| JobError::NoSolution(format!("pictures: {e}"));
    let material = &study.materials.first().ok_or_else(|| failed(&"the study has no material"))?.material;
    let mut evaluated = Vec::new();
    let mut deformed = Vec::new();
    for (label, specimen) in [("base", &result.base.specimen), ("best", &result.best.specimen)] {
        let options =
            EvaluationOptions { mesh: MeshOptions::search(specimen), ..EvaluationOptions::standard(specimen) };
        let mut model = ForwardModel::of_specimen(specimen, &options.mesh).map_err(|e| failed(&e))?;
        let drives = DriveSelection::DriveMm(specimen.drive_mm.clone());
        let (_, maps) = evaluate_model(&mut model, specimen, material, &study.scan, &drives, &options, &|| false)
            .map_err(|e| failed(&e))?;
        if let Some(state) = maps.equilibria.last() {
            let svg = deformed_picture(&model, material, state).map_err(|e| failed(&e))?;
            deformed.push((svg, format!("{label}: {}", specimen.name)));
            let surface = surface_json(&model, material, state).map_err(|e| failed(&e))?;
            outcome.add(format!("surface-{label}.json"), surface);
        }
        evaluated.push((label, maps));
    }
    let panels: Vec<_> = evaluated.iter().map(|(label, maps)| ((*label).to_string(), maps, 0)).collect();
    let histogram = histogram_picture(&panels);
    outcome.add("histogram.svg", histogram.clone());
    Ok(DesignPictures { histogram, deformed })
}
