//! What a result says, in plain words: each sentence is computed from the numbers beside it.

use super::result::DesignEntry;
use super::study::Study;
use serde::{Deserialize, Serialize};

/// How differently integrated sensitivity and Fisher information rank the confirmed designs for one material.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Disagreement {
    /// Name of the prior.
    pub material: String,
    /// Kendall's τ between the two rankings: 1 the same, −1 reversed; null with fewer than two designs.
    pub kendall_tau: Option<f64>,
    /// Rank (from 1) of each confirmed design by the smallest gain in 𝒮.
    pub rank_by_integrated_sensitivity: Vec<usize>,
    /// Rank by the D-optimal figure.
    pub rank_by_information: Vec<usize>,
}

/// The smallest ln gain in 𝒮 over the parameters of a material.
fn integrated_gain(entry: &DesignEntry, material: &str) -> f64 {
    entry
        .gains
        .iter()
        .filter(|g| g.material == material)
        .map(|g| g.integrated_sensitivity.unwrap_or(0.0))
        .fold(f64::INFINITY, f64::min)
}

/// Gain in the D-optimal figure of a material.
fn information_gain(entry: &DesignEntry, base: &DesignEntry, material: usize) -> Option<f64> {
    let own = entry.by_material.get(material)?.relative_sd_by_criterion.d_optimal?;
    Some(base.by_material.get(material)?.relative_sd_by_criterion.d_optimal? / own)
}

/// Ranks from 1, largest value first; equal values by index.
fn ranks(values: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*b].total_cmp(&values[*a]).then(a.cmp(b)));
    let mut ranks = vec![0; values.len()];
    for (rank, index) in order.into_iter().enumerate() {
        ranks[index] = rank + 1;
    }
    ranks
}

/// Compares the two rankings for every material.
pub fn disagreement(study: &Study, base: &DesignEntry, ranked: &[DesignEntry]) -> Vec<Disagreement> {
    study
        .materials
        .iter()
        .enumerate()
        .map(|(index, prior)| {
            let by_sum: Vec<f64> = ranked.iter().map(|e| integrated_gain(e, &prior.name)).collect();
            let by_information: Vec<f64> =
                ranked.iter().map(|e| information_gain(e, base, index).unwrap_or(0.0)).collect();
            let (mut agreeing, mut pairs) = (0i64, 0i64);
            for i in 0..ranked.len() {
                for j in 0..i {
                    let product = (by_sum[i] - by_sum[j]) * (by_information[i] - by_information[j]);
                    // Ties (and what is not a number) count for neither.
                    agreeing += i64::from(product > 0.0) - i64::from(product < 0.0);
                    pairs += 1;
                }
            }
            Disagreement {
                material: prior.name.clone(),
                kendall_tau: (pairs > 0).then(|| agreeing as f64 / pairs as f64),
                rank_by_integrated_sensitivity: ranks(&by_sum),
                rank_by_information: ranks(&by_information),
            }
        })
        .collect()
}

fn holes(count: usize) -> String {
    match count {
        0 => "no hole".into(),
        1 => "one hole".into(),
        n => format!("{n} holes"),
    }
}

fn percent(ratio: f64) -> String {
    format!("{:+.0} %", 100.0 * (ratio - 1.0))
}

/// Sentences for the report.
pub fn findings(
    study: &Study,
    base: &DesignEntry,
    ranked: &[DesignEntry],
    disagreement: &[Disagreement],
) -> Vec<String> {
    let mut said = Vec::new();
    let Some(best) = ranked.first() else { return said };
    said.push(format!(
        "The best specimen within the limits is \"{}\", scanned at {:.2} mm: objective {:.3} times the base specimen's at {:.2} mm.",
        best.specimen.name,
        best.specimen.drive_mm.last().copied().unwrap_or(0.0),
        best.objective,
        base.specimen.drive_mm.last().copied().unwrap_or(0.0),
    ));
    let weakest = best.gains.iter().filter_map(|g| Some((g, g.promised_sd?))).min_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((gain, ratio)) = weakest {
        said.push(format!(
            "Promised standard deviations, base over best: {ratio:.3} or more for every parameter and material (above 1: better; the least is that of {} with material \"{}\").",
            gain.parameter, gain.material
        ));
    }
    // The best of every number of holes, by both measures.
    for (index, prior) in study.materials.iter().enumerate() {
        let mut by_count: std::collections::BTreeMap<usize, (f64, f64)> = std::collections::BTreeMap::new();
        for entry in ranked {
            let slot = by_count.entry(entry.specimen.holes.len()).or_insert((0.0, 0.0));
            slot.0 = slot.0.max(integrated_gain(entry, &prior.name));
            slot.1 = slot.1.max(information_gain(entry, base, index).unwrap_or(0.0));
        }
        let Some(&(solid_sum, solid_information)) = by_count.get(&0) else { continue };
        let holed: Vec<_> = by_count.iter().filter(|(count, _)| **count > 0).collect();
        let best_sum = holed.iter().max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        if let Some((count, (sum, _))) = best_sum {
            let ratio = sum / solid_sum;
            said.push(if ratio > 1.01 {
                format!(
                    "Material \"{}\": holes help the integrated sensitivity; the best found ({}) has {} against the best solid block.",
                    prior.name, holes(**count), percent(ratio)
                )
            } else {
                format!(
                    "Material \"{}\": holes do not help the integrated sensitivity; the best specimen with holes ({}) has {} against the best solid block, because a removed voxel is a lost measurement.",
                    prior.name, holes(**count), percent(ratio)
                )
            });
        }
        let best_information = holed.iter().max_by(|a, b| a.1.1.total_cmp(&b.1.1));
        if let Some((count, (_, information))) = best_information {
            let ratio = information / solid_information;
            said.push(if ratio > 1.01 {
                format!(
                    "Material \"{}\": holes help the Fisher information; the best found ({}) promises a generalised standard deviation {:.2} times smaller than the best solid block's.",
                    prior.name, holes(**count), ratio
                )
            } else {
                format!(
                    "Material \"{}\": holes do not help the Fisher information; the best specimen with holes ({}) promises a generalised standard deviation {:.2} times that of the best solid block.",
                    prior.name, holes(**count), 1.0 / ratio
                )
            });
        }
        if let Some(d) = disagreement.get(index)
            && let Some(tau) = d.kendall_tau
        {
            let top_sum = d.rank_by_integrated_sensitivity.iter().position(|r| *r == 1);
            let top_information = d.rank_by_information.iter().position(|r| *r == 1);
            if let (Some(a), Some(b)) = (top_sum, top_information) {
                said.push(if a == b {
                    format!(
                        "Material \"{}\": both measures put the same design first (rank correlation τ = {tau:.2} over all confirmed designs).",
                        prior.name
                    )
                } else {
                    format!(
                        "Material \"{}\": the measures disagree; integrated sensitivity puts design {} first, Fisher information design {} (rank correlation τ = {tau:.2}). Integrated sensitivity counts stress changes that several parameters share; Fisher information counts only what tells them apart and what the displacements and the force can show.",
                        prior.name, a + 1, b + 1
                    )
                });
            }
        }
        for parameter in prior.material.parameters().into_iter().map(|p| p.name()).filter(|n| n != "kappa") {
            let relative = |e: &DesignEntry| {
                let list = &e.by_material.get(index)?.evaluation.promised_sd;
                list.iter().find(|p| p.parameter == parameter)?.relative_sd
            };
            match (relative(base), relative(best)) {
                (b, Some(o)) if b.is_none_or(|b| b > 0.5) && o <= 0.5 => said.push(format!(
                    "Material \"{}\": {parameter} cannot be seen with the base specimen and can with the best one (relative standard deviation {:.1} %).",
                    prior.name, 100.0 * o
                )),
                (_, Some(o)) if o > 0.5 => said.push(format!(
                    "Material \"{}\": {parameter} cannot be seen with either specimen (relative standard deviation {:.0} % with the best one).",
                    prior.name, 100.0 * o
                )),
                _ => {}
            }
        }
    }
    said
}
