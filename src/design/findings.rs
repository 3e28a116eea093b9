//! What a result says, in plain words: each sentence is computed from the numbers beside it.

use super::aim::{Normalisation, ObjectiveKind};
use super::disagreement::{Disagreement, information_gain, integrated_gain};
use super::entry::DesignEntry;
use super::found_sizes::sizes_in_words;
use super::study::Study;
use super::words::{holes_in_words, listed};
use crate::material::symbol_of_parameter;
use crate::sensitivity::{GridPlace, IDENTIFIABILITY_LIMIT, ScanSettings};
use crate::specimen::{Specimen, way_across_plates};
use crate::voxel::VoxelGrid;

/// A mould maker holds a dimension to about this, mm.
const CLOSE_TO_A_ROW_MM: f64 = 0.1;

/// "12 % more" or "8 % less".
fn more_or_less(ratio: f64) -> String {
    let percent = 100.0 * (ratio - 1.0);
    if percent.abs() < 0.5 {
        "as much".into()
    } else if percent > 0.0 {
        format!("{percent:.0} % more")
    } else {
        format!("{:.0} % less", -percent)
    }
}

/// Best and worst of some factors, as "× 1.02 to × 1.10".
fn factors(values: &[f64]) -> Option<String> {
    let least = values.iter().copied().reduce(f64::min)?;
    let most = values.iter().copied().reduce(f64::max)?;
    Some(if most - least < 5e-4 { format!("×{least:.3}") } else { format!("×{least:.3} to ×{most:.3}") })
}

/// Places in a ranking: the designs that are equal to the first, and the simplest of them.
#[derive(Clone, Copy, Debug)]
pub struct Equals<'a> {
    /// The first included.
    pub equal_to_best: &'a [usize],
    /// One of them.
    pub simplest: usize,
}

/// Sentences for the report: first the winner, its equals and its gains, then what hangs on the scan's grid, then what
/// holes do for each material, then where the two measures disagree, then what can and cannot be seen, then what
/// happened at confirmation.
pub fn findings(
    study: &Study,
    base: &DesignEntry,
    ranked: &[DesignEntry],
    disagreement: &[Disagreement],
    equals: Equals,
    gain_anywhere: Option<f64>,
) -> Vec<String> {
    let Some(best) = ranked.first() else { return Vec::new() };
    let mut said = vec![winner(base, best)];
    said.extend(force_across(study, base, best));
    said.extend(which_are_equal(ranked, equals));
    said.extend(what_is_simpler(ranked, equals));
    said.extend(what_size_does(study, base, best));
    said.extend(gain_anywhere.map(|gain| where_the_grid_lies(best.objective, gain)));
    said.extend(where_voxels_end(&best.specimen, best.evaluation.scan));
    said.extend(how_far_apart(base, best));
    if study.objective.kind == ObjectiveKind::Detect {
        said.extend(sizes_in_words(study, base, best));
    }
    for (index, prior) in study.materials.iter().enumerate() {
        said.extend(gains_of_material(best, &prior.name));
        said.extend(what_holes_do(base, ranked, index, &prior.name));
        said.extend(disagreement.get(index).and_then(|d| where_measures_disagree(d, &prior.name)));
        said.extend(what_is_seen(base, best, index, &prior.name));
    }
    said.extend(at_confirmation(best, ranked));
    said
}

/// Where the study asks to tell materials apart: how well base and winner do.
fn how_far_apart(base: &DesignEntry, best: &DesignEntry) -> Vec<String> {
    best.by_material
        .iter()
        .zip(&base.by_material)
        .filter_map(|(own, of_base)| {
            let (here, there) = (own.separation_sd?, of_base.separation_sd?);
            // χ² of the likelihood ratio is the square; four standard deviations leave few doubts.
            let verdict = if here >= 4.0 { "one scan tells them apart" } else { "one scan does not tell them apart safely" };
            Some(format!(
                "The closest that an earlier material comes to the scan of material \"{}\" is {here:.1} noise standard deviations in \
                 all (base: {there:.1}): {verdict}.",
                own.material
            ))
        })
        .collect()
}

fn winner(base: &DesignEntry, best: &DesignEntry) -> String {
    let drive = |e: &DesignEntry| e.specimen.drive_mm.last().copied().unwrap_or(0.0);
    if best.is_design_of(base) && best.objective < 1.0005 {
        return format!(
            "No design within the limits beats the base specimen at {:.2} mm. Widen the limits or the ranges, or search longer.",
            drive(base)
        );
    }
    let force = |e: &DesignEntry| {
        let (material, force_n) = e.largest_force().unwrap_or(("", 0.0));
        format!("{force_n:.1} N at {:.2} mm with material \"{material}\"", drive(e))
    };
    format!(
        "The best specimen within the limits is \"{}\", scanned at a drive of {:.2} mm. By the study's objective it is {:.3} times \
         as good as the base specimen at {:.2} mm. The largest force that it needs is {} (base: {}).",
        best.specimen.name,
        drive(best),
        best.objective,
        drive(base),
        force(best),
        force(base),
    )
}

/// Where plates are moved before the drive or the force across them is limited: that force.
fn force_across(study: &Study, base: &DesignEntry, best: &DesignEntry) -> Option<String> {
    let is_told =
        study.limits.max_normal_force_n.is_some() || [base, best].iter().any(|e| e.specimen.is_precompressed());
    let (material, force_n) = best.largest_normal_force().filter(|_| is_told)?;
    let in_words = |material: &str, force_n: f64| {
        let way = way_across_plates(force_n);
        format!("{:.1} N with material \"{material}\", which {way}", force_n.abs())
    };
    let of_base = base.largest_normal_force().map_or("no plates".into(), |(m, n)| in_words(m, n));
    let own = in_words(material, force_n);
    Some(format!(
        "The largest force across the plates at that drive is {own} (base: {of_base}); the bonds must bear it."
    ))
}

/// What meshes leave open of the winner's gain, and which design to make of those that are as good.
fn which_are_equal(ranked: &[DesignEntry], Equals { equal_to_best, simplest }: Equals) -> Option<String> {
    let best = ranked.first()?;
    let part = match best.mesh_relative_sd < 5e-4 {
        true => "less than 0.1 %".to_string(),
        false => format!("{:.1} %", 100.0 * best.mesh_relative_sd),
    };
    let open = format!("Meshes leave {part} of this factor open (standard error).");
    let others: Vec<String> = equal_to_best.iter().filter(|i| **i > 0).map(|i| (i + 1).to_string()).collect();
    if others.is_empty() {
        return (best.mesh_relative_sd > 0.0).then_some(open);
    }
    let chosen = ranked.get(simplest)?;
    let advice = if simplest == 0 {
        "The first is also the simplest to make.".to_string()
    } else {
        format!(
            "Number {} (\"{}\", {}, objective {:.3}) is the simplest to make of them, and the one that we recommend.",
            simplest + 1,
            chosen.specimen.name,
            holes_in_words(&chosen.specimen),
            chosen.objective
        )
    };
    let (noun, verb) = if others.len() == 1 { ("design", "is") } else { ("designs", "are") };
    let others = others.join(", ");
    Some(format!(
        "{open} By what they leave open of differences, {noun} {others} of the list {verb} as good as the first. {advice}"
    ))
}

/// Holes of all samples.
fn num_holes(entry: &DesignEntry) -> usize {
    entry.specimen.samples().iter().map(|s| s.holes.len()).sum()
}

/// The best designs with fewer holes than the one recommended, and what they cost.
fn what_is_simpler(ranked: &[DesignEntry], equals: Equals) -> Option<String> {
    let chosen = ranked.get(equals.simplest)?;
    let mut simpler: std::collections::BTreeMap<usize, (usize, &DesignEntry)> = std::collections::BTreeMap::new();
    for (place, entry) in ranked.iter().enumerate().filter(|(_, e)| e.is_within_limits) {
        if num_holes(entry) < num_holes(chosen) {
            let best = simpler.entry(num_holes(entry)).or_insert((place, entry));
            if entry.objective > best.1.objective {
                *best = (place, entry);
            }
        }
    }
    let each = simpler.values().rev().map(|(place, entry)| {
        let less = 100.0 * (1.0 - entry.objective / chosen.objective);
        format!("number {} with {} is {less:.1} % worse", place + 1, holes_in_words(&entry.specimen))
    });
    let each: Vec<String> = each.collect();
    (!each.is_empty()).then(|| format!("Simpler to make within the limits: {}.", listed(&each)))
}

/// Where blocks may differ: what of the gain is size and what is geometry.
fn what_size_does(study: &Study, base: &DesignEntry, best: &DesignEntry) -> Option<String> {
    let sizes = |e: &DesignEntry| e.specimen.samples().iter().map(|s| s.block).collect::<Vec<_>>();
    if sizes(best) == sizes(base) {
        return None;
    }
    let ratio = best.volume_mm3 / base.volume_mm3;
    let sums = best.gains.iter().filter_map(|g| g.integrated_sensitivity);
    let per_volume: Vec<f64> = match study.objective.normalisation {
        Normalisation::MeanPerVoxel => sums.collect(),
        Normalisation::Sum | Normalisation::VolumeIntegral => sums.map(|s| s / ratio).collect(),
    };
    // Twice the voxels of the same information halve the variance.
    let sds: Vec<f64> = best.gains.iter().filter_map(|g| g.promised_sd).map(|s| s / ratio.sqrt()).collect();
    let (Some(per_volume), Some(sds)) = (factors(&per_volume), factors(&sds)) else { return None };
    let size = |e: &DesignEntry| {
        let b = &e.specimen.block;
        format!("{:.1} × {:.2} × {:.1} mm", b.length_mm, b.thickness_mm, b.width_mm)
    };
    Some(format!(
        "Part of this is size: the block is {} (base: {}) and holds {:.2} times the base's material, which alone makes integrated \
         sensitivities ×{ratio:.2} and standard deviations ×{:.2} better. Shape and strain make the rest: {per_volume} in the \
         integrated sensitivities and {sds} in the standard deviations.",
        size(best),
        size(base),
        ratio,
        ratio.sqrt()
    ))
}

/// What is left of the winner's factor where the scan's grid lies anywhere.
fn where_the_grid_lies(centred: f64, anywhere: f64) -> String {
    format!(
        "The factor of {centred:.3} is of a grid on the middle of each specimen. On average over all places where the grid may \
         lie it is {anywhere:.3}: how many rows of voxels come in at the free faces then decides nothing. A study whose scan has \
         \"grid\": \"anywhere\" searches for that."
    )
}

/// A block whose free faces hardly reach the outermost rows of the scan's voxels: much is seen there, and lost if the
/// block comes out smaller or lies elsewhere.
fn where_voxels_end(specimen: &Specimen, scan: ScanSettings) -> Option<String> {
    if scan.surface.is_some() || scan.grid != GridPlace::Centred {
        return None;
    }
    let spare_mm = VoxelGrid::spare_mm(specimen, scan.voxel_mm).ok()?;
    let extents = [("length", specimen.block.length_mm), ("width", specimen.block.width_mm)];
    let close = extents.into_iter().zip([0, 2]).filter(|(_, axis)| spare_mm[*axis] < CLOSE_TO_A_ROW_MM);
    let named: Vec<String> = close
        .map(|((name, extent_mm), axis)| {
            let by = match spare_mm[axis] {
                spare_mm if spare_mm < 0.005 => "any".into(),
                spare_mm => format!("{spare_mm:.2} mm"),
            };
            format!("its {name} ({extent_mm:.1} mm) comes out {by} smaller")
        })
        .collect();
    if named.is_empty() {
        return None;
    }
    Some(format!(
        "Part of this factor hangs on where the scan's voxels lie: the free faces hardly reach the outermost voxels, and a \
         row of them is lost where the block lies off the middle of the grid, or {}. Much of what tells the \
         parameters apart is seen at free faces. Evaluate a block that is {CLOSE_TO_A_ROW_MM} mm smaller before this one \
         is made.",
        named.join(", or ")
    ))
}

/// Both measures of one material, parameter by parameter where they get worse.
fn gains_of_material(best: &DesignEntry, material: &str) -> Option<String> {
    let of_material: Vec<_> = best.gains.iter().filter(|g| g.material == material).collect();
    let sums: Vec<f64> = of_material.iter().filter_map(|g| g.integrated_sensitivity).collect();
    let sds: Vec<f64> = of_material.iter().filter_map(|g| g.promised_sd).collect();
    let mut text = format!(
        "Material \"{material}\": against the base, the best specimen's integrated sensitivities are {}",
        factors(&sums)?
    );
    match factors(&sds) {
        None => text += "; no standard deviation is determined.",
        Some(range) => text += &format!("; its promised standard deviations are smaller by {range}."),
    }
    let lost: Vec<String> = of_material
        .iter()
        .filter_map(|g| Some((g, g.promised_sd?)))
        .filter(|(_, ratio)| *ratio < 0.9995)
        .map(|(g, ratio)| {
            format!(
                "{} is promised {:.1} % less precisely",
                symbol_of_parameter(&g.parameter),
                100.0 * (1.0 / ratio - 1.0)
            )
        })
        .collect();
    if !lost.is_empty() {
        text += &format!(" A factor below 1 is a loss: {}.", lost.join(", "));
    }
    let worst = of_material.iter().filter_map(|g| Some((g, g.worst_promised_sd?))).min_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((gain, ratio)) = worst
        && sds.iter().copied().fold(f64::INFINITY, f64::min) - ratio > 5e-4
    {
        text += &format!(
            " If the material is stiffer or softer than assumed, the least factor is ×{ratio:.3} ({}).",
            symbol_of_parameter(&gain.parameter)
        );
    }
    Some(text)
}

/// The best design with holes, by both measures, against the solid block: designs that keep every limit of mould, rig
/// and material, whether or not they keep the guard, so that like is compared with like.
fn what_holes_do(base: &DesignEntry, ranked: &[DesignEntry], index: usize, material: &str) -> Vec<String> {
    let kept = ranked.iter().filter(|e| e.limits.iter().all(|limit| limit.is_satisfied));
    let (solid, holed): (Vec<&DesignEntry>, Vec<&DesignEntry>) = kept.partition(|e| num_holes(e) == 0);
    if solid.is_empty() {
        let was_tried = index == 0 && ranked.iter().any(|e| num_holes(e) == 0);
        let said = "No solid block kept every limit at confirmation, so that nothing is said of what holes do.";
        return was_tried.then(|| said.to_string()).into_iter().collect();
    }
    // The best of some designs by a measure, and what that is.
    fn best_of<'a>(
        designs: &[&'a DesignEntry],
        measure: &dyn Fn(&DesignEntry) -> f64,
    ) -> Option<(&'a DesignEntry, f64)> {
        designs.iter().map(|e| (*e, measure(e))).max_by(|a, b| a.1.total_cmp(&b.1))
    }
    let ratio = |measure: &dyn Fn(&DesignEntry) -> f64| {
        let ((_, of_solid), (best, of_holed)) = (best_of(&solid, measure)?, best_of(&holed, measure)?);
        Some((best, of_holed / of_solid))
    };
    let has_notches = holed.iter().any(|e| e.specimen.samples().iter().flat_map(|s| &s.holes).any(|h| h.is_notch));
    let noun = if has_notches { "holes or notches" } else { "holes" };
    let mut said = Vec::new();
    if let Some((best, ratio)) = ratio(&|e| integrated_gain(e, material)) {
        let (verb, reason) =
            if ratio > 1.005 { ("help", "") } else { ("do not help", ": a removed voxel is a lost measurement") };
        said.push(format!(
            "Material \"{material}\": {noun} {verb} the integrated sensitivity. The best confirmed specimen with {noun} ({}) has {} of it \
             than the best solid block within the same limits{reason}.",
            holes_in_words(&best.specimen),
            more_or_less(ratio).replace("as much", "no more and no less")
        ));
    }
    if let Some((best, gain)) = ratio(&|e| information_gain(e, base, index).unwrap_or(0.0)) {
        // A standard deviation; smaller is better.
        let ratio = 1.0 / gain;
        said.push(if !ratio.is_finite() {
            format!("Material \"{material}\": the standard deviations of the confirmed designs are not determined.")
        } else {
            let percent = 100.0 * (ratio - 1.0).abs();
            let (verb, much) = if ratio < 0.995 {
                ("help", format!("{percent:.0} % smaller"))
            } else if ratio < 1.005 {
                ("do not help", "no smaller".to_string())
            } else {
                ("do not help", format!("{percent:.0} % larger"))
            };
            format!(
                "Material \"{material}\": {noun} {verb} to tell the parameters apart. The best confirmed specimen with {noun} ({}) promises \
                 a generalised standard deviation {much} than the best solid block's within the same limits.",
                holes_in_words(&best.specimen)
            )
        });
    }
    said
}

fn where_measures_disagree(d: &Disagreement, material: &str) -> Option<String> {
    let tau = d.kendall_tau?;
    let by_sum = d.rank_by_integrated_sensitivity.iter().position(|r| *r == 1)?;
    let by_information = d.rank_by_information.iter().position(|r| *r == 1)?;
    Some(if by_sum == by_information {
        format!(
            "Material \"{material}\": integrated sensitivity and Fisher information put the same design first (number {}); over all \
             confirmed designs their rank correlation is τ = {tau:.2} (1: the same order, −1: reversed).",
            by_sum + 1
        )
    } else {
        format!(
            "Material \"{material}\": the measures disagree. Integrated sensitivity puts design {} first, Fisher information design {} \
             (rank correlation τ = {tau:.2}; 1: the same order, −1: reversed). Integrated sensitivity also counts stress changes that \
             several parameters share; Fisher information counts only what tells them apart and shows in the displacements or the force.",
            by_sum + 1,
            by_information + 1
        )
    })
}

/// Parameters that come into sight, go out of sight or stay out of it.
fn what_is_seen(base: &DesignEntry, best: &DesignEntry, index: usize, material: &str) -> Vec<String> {
    let Some(of_best) = best.by_material.get(index) else { return Vec::new() };
    let mut said = Vec::new();
    for parameter in of_best.evaluation.promised_sd.iter().filter(|p| p.is_of_shear()).map(|p| &p.parameter) {
        let relative = |e: &DesignEntry| {
            let list = &e.by_material.get(index)?.evaluation.promised_sd;
            list.iter().find(|p| p.parameter == *parameter)?.relative_sd
        };
        let name = symbol_of_parameter(parameter);
        let percent = |sd: Option<f64>| sd.map_or("undetermined".into(), |sd| format!("{:.0} %", 100.0 * sd));
        let is_seen = |sd: Option<f64>| sd.is_some_and(|sd| sd <= IDENTIFIABILITY_LIMIT);
        let (of_base, of_best) = (relative(base), relative(best));
        let limit = 100.0 * IDENTIFIABILITY_LIMIT;
        match (is_seen(of_base), is_seen(of_best)) {
            (true, true) => {}
            (false, true) => said.push(format!(
                "Material \"{material}\": {name} cannot be seen with the base specimen (relative standard deviation {}, above {limit:.0} %) \
                 and can with the best one ({}).",
                percent(of_base),
                percent(of_best)
            )),
            (true, false) => said.push(format!(
                "Caution. Material \"{material}\": {name} can be seen with the base specimen (relative standard deviation {}) and no longer \
                 with the best one ({}, above {limit:.0} %). If this material is likely, guard every material or take another design of the list.",
                percent(of_base),
                percent(of_best)
            )),
            (false, false) => said.push(format!(
                "Material \"{material}\": {name} cannot be seen with either specimen (relative standard deviation {} with the base, {} with \
                 the best).",
                percent(of_base),
                percent(of_best)
            )),
        }
    }
    said
}

/// Limits that only the fine mesh broke, and repairs.
fn at_confirmation(best: &DesignEntry, ranked: &[DesignEntry]) -> Vec<String> {
    let mut said = Vec::new();
    if let Some(remark) = &best.remark {
        said.push(format!("On the best specimen: {remark}"));
    }
    let better = ranked.iter().filter(|e| !e.is_within_limits && e.remark.is_some() && e.objective > best.objective);
    let count = better.count();
    if count > 0 {
        said.push(format!(
            "{count} design{} with a larger gain kept every limit on the coarse mesh of the search and missed one at confirmation; \
             see the remarks in the list.",
            if count == 1 { "" } else { "s" }
        ));
    }
    said
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words() {
        assert_eq!(factors(&[1.1, 0.9]).as_deref(), Some("×0.900 to ×1.100"));
        assert_eq!(factors(&[1.1]).as_deref(), Some("×1.100"));
        assert_eq!(factors(&[]), None);
        assert_eq!(more_or_less(1.12), "12 % more");
        assert_eq!(more_or_less(0.92), "8 % less");
        assert_eq!(more_or_less(1.001), "as much");
    }

    /// 29.5 mm are 29.5 voxels, of which the outermost are kept by a hair; of 29.8 mm there is enough.
    #[test]
    fn factors_that_hang_on_the_grid_are_said() {
        let scan = ScanSettings::default();
        let mut specimen = Specimen::from_json(include_str!("../../geometries/solid-shear.json")).expect("valid");
        (specimen.block.length_mm, specimen.block.width_mm) = (29.5, 21.75);
        let said = where_voxels_end(&specimen, scan).expect("the length is close");
        assert!(said.contains("its length (29.5 mm) comes out any smaller") && !said.contains("its width"), "{said}");
        specimen.block.length_mm = 29.8;
        assert_eq!(where_voxels_end(&specimen, scan), None);
        specimen.block.length_mm = 29.5;
        assert_eq!(where_voxels_end(&specimen, ScanSettings { grid: GridPlace::Anywhere, ..scan }), None);
    }
}
