//! The base and the best specimen once more, for the pictures that need fields.

use super::subject::name_of_sample;
use super::{JobError, Outcome};
use crate::design::{DesignResult, Study};
use crate::mesh::MeshOptions;
use crate::report::{DesignPictures, deformed_picture, histogram_picture, surface_json};
use crate::sensitivity::{DriveSelection, EvaluationOptions, Fixture, Protocol, evaluate_fixture};

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
    let prior = study.materials.first().ok_or_else(|| failed(&"the study has no material"))?;
    let material = &prior.material;
    let mut evaluated = Vec::new();
    let mut deformed = Vec::new();
    for (label, entry) in [("base", &result.base), ("best", &result.best)] {
        let specimen = &entry.specimen;
        let options = EvaluationOptions {
            mesh: MeshOptions::search(specimen),
            protocol: Protocol { blocks_scanned: study.protocol.blocks_scanned, ..Protocol::default() },
            ..EvaluationOptions::standard(specimen)
        };
        let drives = DriveSelection::DriveMm(specimen.drive_mm.clone());
        let mut fixture = Fixture::new(specimen, &entry.evaluation.scan, &options).map_err(|e| failed(&e))?;
        let (_, maps) =
            evaluate_fixture(&mut fixture, material, &drives, &[], &options, &|| false).map_err(|e| failed(&e))?;
        for (index, (part, sample)) in fixture.parts().iter().zip(&maps.samples).enumerate() {
            let Some(state) = sample.equilibria.last() else { continue };
            let svg = deformed_picture(&part.model, material, state).map_err(|e| failed(&e))?;
            deformed.push((svg, format!("{label}: {}, material \"{}\"", part.specimen.name, prior.name)));
            let surface = surface_json(&part.model, material, state).map_err(|e| failed(&e))?;
            outcome.add(format!("{}.json", name_of_sample(&format!("surface-{label}"), index)), surface);
        }
        evaluated.push((label, maps));
    }
    let mut panels = Vec::new();
    for (label, maps) in &evaluated {
        for (number, sample) in maps.samples.iter().enumerate() {
            let of = if maps.samples.len() > 1 { format!(", sample {}", number + 1) } else { String::new() };
            panels.extend(sample.drives.last().map(|d| (format!("{label}{of}"), &d.states[..])));
        }
    }
    let histogram = histogram_picture(&panels);
    outcome.add("histogram.svg", histogram.clone());
    Ok(DesignPictures { histogram, deformed })
}
