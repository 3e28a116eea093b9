//! Linear relaxation of an elastic history: the Prony convolution and its derivatives.
//!
//! F(t) = F∞(t) + Σᵢ gᵢ ∫₀ᵗ e^{−(t−s)/τᵢ} dF∞(s). F∞ is the equilibrium response, so that an instantaneous change
//! answers with (1 + Σ gᵢ) times the equilibrium one (Simo 1987, doi 10.1016/0045-7825(87)90107-1, in equilibrium
//! normalisation). Between samples F∞ is taken as linear in time; then the recursion hᵢ ← e^{−Δt/τᵢ} hᵢ + gᵢ φ(Δt/τᵢ)
//! ΔF∞, φ(x) = (1 − e^{−x})/x, is exact. Before the first sample the state is at rest: all hᵢ start at zero, whatever
//! the first value is.

use serde::{Deserialize, Serialize};

/// One relaxation: strength relative to equilibrium and time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PronyTerm {
    /// g, relative to the equilibrium response.
    pub strength: f64,
    /// τ, s.
    pub time_s: f64,
}

/// Why a history cannot be relaxed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum HistoryError {
    /// Times and values are not of the same number.
    #[error("there are {times} times and {values} values; give one value per time")]
    Length {
        /// Times.
        times: usize,
        /// Values.
        values: usize,
    },
    /// Time runs backwards, or is not a number.
    #[error("time {time_s} s at sample {index} is not after the one before; sort the samples by time")]
    Time {
        /// Index of the sample.
        index: usize,
        /// Its time, s.
        time_s: f64,
    },
    /// τ is not positive, or g not a number.
    #[error("relaxation with strength {strength} and time {time_s} s; the time must be positive and both finite")]
    Term {
        /// g.
        strength: f64,
        /// τ, s.
        time_s: f64,
    },
    /// A value is not finite.
    #[error("value {value} at sample {index} is not finite; leave such samples out")]
    Value {
        /// Index of the sample.
        index: usize,
        /// The value.
        value: f64,
    },
}

/// Times must rise: strictly, but for jumps (two samples at one time are a step).
pub(crate) fn check_times(times_s: &[f64], num_values: usize) -> Result<(), HistoryError> {
    if times_s.len() != num_values {
        return Err(HistoryError::Length { times: times_s.len(), values: num_values });
    }
    for (index, &time_s) in times_s.iter().enumerate() {
        let is_after = index == 0 || time_s >= times_s[index - 1];
        if !(time_s.is_finite() && is_after) {
            return Err(HistoryError::Time { index, time_s });
        }
    }
    Ok(())
}

/// φ(x) = (1 − e^{−x})/x and φ′(x).
fn ramp_share(x: f64) -> (f64, f64) {
    if x < 1e-4 {
        // Next terms are below 1e-13.
        return (1.0 - x / 2.0 + x * x / 6.0, -0.5 + x / 3.0 - x * x / 8.0);
    }
    let share = -(-x).exp_m1() / x;
    (share, ((-x).exp() - share) / x)
}

/// ∫ e^{−(t−s)/τ} dF∞ at every sample, and its derivative with respect to τ (per s).
pub(crate) fn memory(times_s: &[f64], elastic: &[f64], tau_s: f64) -> (Vec<f64>, Vec<f64>) {
    let (mut h, mut slope) = (0.0, 0.0);
    let mut values = Vec::with_capacity(elastic.len());
    let mut slopes = Vec::with_capacity(elastic.len());
    for n in 0..elastic.len() {
        if n > 0 {
            let x = (times_s[n] - times_s[n - 1]) / tau_s;
            let change = elastic[n] - elastic[n - 1];
            let decay = (-x).exp();
            let (share, share_slope) = ramp_share(x);
            // dx/dτ = −x/τ.
            slope = decay * (slope + h * x / tau_s) - share_slope * x / tau_s * change;
            h = decay * h + share * change;
        }
        values.push(h);
        slopes.push(slope);
    }
    (values, slopes)
}

/// A relaxed history with its derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct RelaxedHistory {
    /// F at every sample, in the unit of the elastic values.
    pub values: Vec<f64>,
    /// ∂F/∂gᵢ: one list per term.
    pub by_strength: Vec<Vec<f64>>,
    /// ∂F/∂τᵢ, per s: one list per term.
    pub by_time: Vec<Vec<f64>>,
}

/// F(t) at the samples from the equilibrium response `elastic` there. The operation is linear in `elastic`: the
/// derivative with respect to a parameter of the elastic response is this function applied to that response's
/// derivative.
///
/// # Errors
/// [`HistoryError`].
///
/// ```
/// use lambdak::rate::{PronyTerm, relax};
/// let (g, tau) = (0.4, 5.0);
/// // A jump at t = 0, then rest: two samples at one time are a step.
/// let times = [0.0, 0.0, 1.0, 10.0];
/// let found = relax(&times, &[0.0, 2.0, 2.0, 2.0], &[PronyTerm { strength: g, time_s: tau }]).unwrap();
/// assert!((found.values[1] - 2.0 * (1.0 + g)).abs() < 1e-12);
/// assert!((found.values[3] - 2.0 * (1.0 + g * (-10.0f64 / tau).exp())).abs() < 1e-12);
/// ```
pub fn relax(times_s: &[f64], elastic: &[f64], terms: &[PronyTerm]) -> Result<RelaxedHistory, HistoryError> {
    check_times(times_s, elastic.len())?;
    if let Some(index) = elastic.iter().position(|v| !v.is_finite()) {
        return Err(HistoryError::Value { index, value: elastic[index] });
    }
    let mut out = RelaxedHistory { values: elastic.to_vec(), by_strength: Vec::new(), by_time: Vec::new() };
    for term in terms {
        if !(term.time_s > 0.0 && term.time_s.is_finite() && term.strength.is_finite()) {
            return Err(HistoryError::Term { strength: term.strength, time_s: term.time_s });
        }
        let (memory, slope) = memory(times_s, elastic, term.time_s);
        for (value, m) in out.values.iter_mut().zip(&memory) {
            *value += term.strength * m;
        }
        out.by_time.push(slope.iter().map(|s| term.strength * s).collect());
        out.by_strength.push(memory);
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TERMS: [PronyTerm; 2] =
        [PronyTerm { strength: 0.25, time_s: 8.0 }, PronyTerm { strength: 0.15, time_s: 60.0 }];

    /// A ramp of rate r then a hold: h = g r τ (1 − e^{−t/τ}) on the ramp, decaying after it. Exact for any sampling.
    #[test]
    fn ramp_and_hold() {
        let (rate, end) = (0.3, 20.0);
        let elastic = |t: f64| rate * t.min(end);
        let exact = |t: f64| {
            let relaxed: f64 = TERMS
                .iter()
                .map(|p| {
                    let at_end = p.strength * rate * p.time_s * -(-t.min(end) / p.time_s).exp_m1();
                    at_end * (-(t - end).max(0.0) / p.time_s).exp()
                })
                .sum();
            elastic(t) + relaxed
        };
        for times in
            [vec![0.0, 20.0, 50.0], (0..=100).map(|i| 0.5 * f64::from(i)).collect(), vec![0.0, 1e-6, 20.0, 50.0]]
        {
            let values: Vec<f64> = times.iter().map(|&t| elastic(t)).collect();
            let found = relax(&times, &values, &TERMS).unwrap();
            for (t, v) in times.iter().zip(&found.values) {
                assert!((v - exact(*t)).abs() < 1e-12, "{t}: {v} {}", exact(*t));
            }
        }
    }

    /// A sine in its steady state: storage and loss factors 1 + Σ g ω²τ²/(1+ω²τ²) and Σ g ωτ/(1+ω²τ²). Sampling at
    /// 1/400 of a period leaves (2π/400)²/12 = 2e-5 relative.
    #[test]
    fn steady_sine() {
        let omega: f64 = 0.2;
        let step = 2.0 * std::f64::consts::PI / omega / 400.0;
        let times: Vec<f64> = (0..40_000).map(|i| step * f64::from(i)).collect();
        let elastic: Vec<f64> = times.iter().map(|t| (omega * t).sin()).collect();
        let found = relax(&times, &elastic, &TERMS).unwrap();
        let (mut storage, mut loss) = (1.0, 0.0);
        for p in TERMS {
            let x = omega * p.time_s;
            storage += p.strength * x * x / (1.0 + x * x);
            loss += p.strength * x / (1.0 + x * x);
        }
        for i in 39_000..40_000 {
            let exact = storage * (omega * times[i]).sin() + loss * (omega * times[i]).cos();
            assert!((found.values[i] - exact).abs() < 3e-5, "{i} {} {exact}", found.values[i]);
        }
    }

    /// Linear in g: exact. In τ: Taylor remainder of second order.
    #[test]
    fn derivatives_pass_the_taylor_test() {
        let times: Vec<f64> = (0..200).map(|i| 0.4 * f64::from(i) + 0.1 * f64::from(i % 3)).collect();
        let elastic: Vec<f64> = times.iter().map(|t| (0.3 * t).sin() + 0.02 * t).collect();
        let base = relax(&times, &elastic, &TERMS).unwrap();
        for term in 0..2 {
            let moved = |dg: f64, dt: f64| {
                let mut terms = TERMS;
                terms[term].strength += dg;
                terms[term].time_s += dt;
                let found = relax(&times, &elastic, &terms).unwrap().values;
                (0..times.len())
                    .map(|n| {
                        let linear = dg * base.by_strength[term][n] + dt * base.by_time[term][n];
                        (found[n] - base.values[n] - linear).abs()
                    })
                    .fold(0.0, f64::max)
            };
            assert!(moved(0.1, 0.0) < 1e-13);
            let (coarse, fine) = (moved(0.0, 0.4), moved(0.0, 0.04));
            assert!(fine < 0.015 * coarse, "{coarse} {fine}");
        }
        // Small steps use a series: it must join on.
        let (a, b) = (ramp_share(0.99e-4), ramp_share(1.01e-4));
        assert!((a.0 - b.0 - 1e-6).abs() < 1e-9 && (a.1 - b.1).abs() < 1e-6, "{a:?} {b:?}");
    }

    #[test]
    fn bad_histories_are_refused() {
        assert!(matches!(relax(&[0.0], &[], &[]), Err(HistoryError::Length { .. })));
        assert!(matches!(relax(&[0.0, -1.0], &[0.0, 0.0], &[]), Err(HistoryError::Time { index: 1, .. })));
        assert!(matches!(relax(&[0.0, f64::NAN], &[0.0, 0.0], &[]), Err(HistoryError::Time { .. })));
        assert!(matches!(relax(&[0.0], &[f64::INFINITY], &[]), Err(HistoryError::Value { .. })));
        let term = PronyTerm { strength: 1.0, time_s: 0.0 };
        assert!(matches!(relax(&[0.0], &[1.0], &[term]), Err(HistoryError::Term { .. })));
    }
}
