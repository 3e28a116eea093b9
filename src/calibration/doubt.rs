//! When what a verified specimen promises is not to be trusted, and why.

use super::verify::ParameterSpread;

/// Between these the spread found over the spread promised is taken to be the promised one.
const SPREAD_AS_PROMISED: [f64; 2] = [0.8, 1.25];
/// A mean further from the truth than so many promised standard deviations is biased.
const LARGEST_BIAS: f64 = 1.0;

impl ParameterSpread {
    /// Spread found over spread promised; none where nothing was promised or found.
    pub fn found_over_promised(&self) -> Option<f64> {
        self.promised_sd.map(|sd| self.found_sd / sd).filter(|ratio| ratio.is_finite())
    }

    /// Relative standard error of the spread found: that of a standard deviation of n normal draws.
    pub fn spread_error(draws: usize) -> f64 {
        1.0 / (2.0 * (draws.max(2) as f64 - 1.0)).sqrt()
    }

    /// Why the promise for this parameter is not to be trusted, in words; nothing where it is, or where the parameter
    /// is not identifiable and nothing was promised.
    pub(super) fn reasons_for_doubt(&self) -> Vec<String> {
        let mut doubts = Vec::new();
        let Some(promised) = self.promised_sd.filter(|_| self.identifiable) else { return doubts };
        if self.draws == 0 {
            doubts.push("no calibration succeeded".to_string());
            return doubts;
        }
        let [low, high] = SPREAD_AS_PROMISED;
        if let Some(ratio) = self.found_over_promised().filter(|r| *r < low || *r > high) {
            doubts.push(format!(
                "the spread found is {ratio:.2} times the one promised, outside {low} to {high} ({} draws alone leave it \
                 uncertain by {:.0} %)",
                self.draws,
                100.0 * ParameterSpread::spread_error(self.draws)
            ));
        }
        let bias = (self.mean - self.truth) / promised;
        if bias.abs() > LARGEST_BIAS {
            let of_mesh =
                self.discretisation_bias.map_or(String::new(), |b| format!(", {:.1} of them the mesh's", b / promised));
            doubts.push(format!("the mean is {bias:.1} promised standard deviations off the truth{of_mesh}"));
        }
        doubts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spread(found_sd: f64, mean: f64) -> ParameterSpread {
        ParameterSpread {
            parameter: "mu_1".into(),
            truth: 2.0,
            mean,
            found_sd,
            promised_sd: Some(0.1),
            identifiable: true,
            draws: 20,
            failed_draws: 0,
            estimates: Vec::new(),
            discretisation_bias: Some(0.05),
            is_mesh_corrected: true,
            limited_draws: 0,
            doubts: Vec::new(),
        }
    }

    /// The limits of the rule, from both sides, and what it says.
    #[test]
    fn a_promise_is_doubted_for_its_spread_and_its_bias() {
        for (found_sd, mean, num) in
            [(0.081, 2.0, 0), (0.124, 2.09, 0), (0.079, 2.0, 1), (0.126, 2.0, 1), (0.1, 1.89, 1), (0.2, 2.2, 2)]
        {
            let doubts = spread(found_sd, mean).reasons_for_doubt();
            assert_eq!(doubts.len(), num, "{found_sd} {mean}: {doubts:?}");
        }
        let said = spread(0.2, 2.2).reasons_for_doubt().join("; ");
        assert!(said.contains("2.00 times") && said.contains("2.0 promised") && said.contains("0.5 of them"), "{said}");
        let unseen = ParameterSpread { identifiable: false, ..spread(0.2, 2.2) };
        assert!(unseen.reasons_for_doubt().is_empty());
    }
}
