//! Intervals of 95 % from standard deviations.

use crate::material::Parameter;

/// 97.5 % point of the standard normal distribution: half the width of an interval of 95 %, in standard deviations.
pub const TWO_SIDED_95: f64 = 1.959_963_984_540_054;

/// The interval of a parameter about its estimate: 1.96 standard deviations, and in squares the furthest that an error
/// of the size of the misfit could shift it.
///
/// κ is fitted by its logarithm, and its interval is symmetric in that. The moduli of Ogden's terms keep their sign;
/// where they are hardly known it is their logarithm, too, that scatters like a Gaussian: an estimate that comes out
/// low promises a standard deviation lower by the same factor, so that symmetric intervals about low estimates are too
/// short. What they scatter by is therefore taken in their logarithm, which changes nothing where it is small; what
/// shifts them is a shift of the modulus itself.
pub(super) fn interval_95(parameter: Parameter, value: f64, sd: f64, possible_shift: f64) -> [f64; 2] {
    let scatter = TWO_SIDED_95 * sd;
    let in_logarithm = |side: f64, half_width: f64| {
        if value == 0.0 { side * half_width } else { value * (side * half_width / value).exp() }
    };
    [-1.0, 1.0].map(|side| match parameter {
        Parameter::Kappa => in_logarithm(side, scatter.hypot(possible_shift)),
        Parameter::Mu(_) => value + side * (in_logarithm(side, scatter) - value).hypot(possible_shift),
        Parameter::Alpha(_) | Parameter::Law(_) => value + side * scatter.hypot(possible_shift),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_keep_their_sign_and_exponents_are_symmetric() {
        // 1.96 standard deviations are 1.
        let sd = 1.0 / TWO_SIDED_95;
        let [low, high] = interval_95(Parameter::Mu(0), 2.0, sd, 0.0);
        // Symmetric in the logarithm, to rounding.
        assert!((low * high - 4.0).abs() < 1e-14 && (high / 2.0 - 0.5f64.exp()).abs() < 1e-14);
        let negative = interval_95(Parameter::Mu(1), -2.0, sd, 0.0);
        assert!((negative[0] + high).abs() < 1e-14 && (negative[1] + low).abs() < 1e-14, "{negative:?}");
        // Three and four make five.
        let [low, high] = interval_95(Parameter::Alpha(0), 2.0, 3.0 * sd, 4.0);
        assert!((low + 3.0).abs() < 1e-14 && (high - 7.0).abs() < 1e-14);
        // A shift is one of the modulus, whatever it scatters by.
        let [low, high] = interval_95(Parameter::Mu(0), 2.0, 0.0, 5.0);
        assert!((low + 3.0).abs() < 1e-14 && (high - 7.0).abs() < 1e-14);
        // Of a small standard deviation all are the same, to its square.
        for parameter in [Parameter::Kappa, Parameter::Mu(0), Parameter::Alpha(0)] {
            let [low, high] = interval_95(parameter, 1.0, 1e-3 * sd, 0.0);
            assert!((low - 0.999).abs() < 1e-6 && (high - 1.001).abs() < 1e-6);
        }
        let [low, high] = interval_95(Parameter::Mu(0), 0.0, sd, 0.0);
        assert!((low + 1.0).abs() < 1e-14 && (high - 1.0).abs() < 1e-14);
    }
}
