//! How differently integrated sensitivity and Fisher information rank designs.

use super::entry::DesignEntry;
use super::study::Study;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// How differently integrated sensitivity and Fisher information rank the confirmed designs for one material.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
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
pub(super) fn integrated_gain(entry: &DesignEntry, material: &str) -> f64 {
    entry
        .gains
        .iter()
        .filter(|g| g.material == material)
        .map(|g| g.integrated_sensitivity.unwrap_or(0.0))
        .fold(f64::INFINITY, f64::min)
}

/// Gain in the D-optimal figure of a material.
pub(super) fn information_gain(entry: &DesignEntry, base: &DesignEntry, material: usize) -> Option<f64> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_values_rank_by_index() {
        assert_eq!(ranks(&[1.0, 3.0, 3.0, 2.0]), [4, 1, 2, 3]);
    }
}
