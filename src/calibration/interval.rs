//! Intervals of 95 % from standard deviations.

use crate::material::Parameter;

/// 97.5 % point of the standard normal distribution: half the width of an interval of 95 %, in standard deviations.
pub const TWO_SIDED_95: f64 = 1.959_963_984_540_054;

/// Standard deviation of what may be anything from nothing to twice a shift, each as likely as another, as a part of
/// that shift: 1/√12 of the range of an even distribution.
pub const SD_OVER_SHIFT: f64 = 0.58;

/// The ends of the 95 % interval that a standard deviation leaves a parameter.
///
/// κ is fitted by its logarithm, and its interval is symmetric in that. The moduli of Ogden's terms keep their sign;
/// where they are hardly known it is their logarithm, too, that scatters like a Gaussian: an estimate that comes out
/// low promises a standard deviation lower by the same factor, so that symmetric intervals about low estimates are too
/// short.
pub(super) fn linear_ends(parameter: Parameter, value: f64, sd: f64) -> [f64; 2] {
    let scatter = TWO_SIDED_95 * sd;
    [-1.0, 1.0].map(|side| match parameter {
        Parameter::Kappa | Parameter::Mu(_) if value != 0.0 => value * (side * scatter / value).exp(),
        _ => value + side * scatter,
    })
}

/// The ends that the noise leaves a parameter, moved outwards by what else it is uncertain by: a standard deviation
/// from discretisation, and in squares the furthest that an error of the size of the misfit could shift it. An open
/// side, which is none, stays open.
///
/// What moduli scatter by adds up in their logarithm, which changes nothing where it is small; what shifts them is a
/// shift of the modulus itself.
pub(super) fn widened(
    parameter: Parameter,
    value: f64,
    [low, high]: [Option<f64>; 2],
    discretisation_sd: f64,
    possible_shift: f64,
) -> [Option<f64>; 2] {
    let discretisation = TWO_SIDED_95 * discretisation_sd;
    let moved = |side: f64, end: f64| {
        let in_logarithm = |further: f64| {
            let distance = (end / value).ln().hypot(further);
            value * (side * value.signum() * distance).exp()
        };
        match parameter {
            Parameter::Kappa => in_logarithm(discretisation.hypot(possible_shift) / value),
            Parameter::Mu(_) if value != 0.0 => {
                let end = in_logarithm(as_factor(discretisation / value.abs()));
                value + side * (end - value).hypot(possible_shift)
            }
            Parameter::Mu(_) => side * end.hypot(discretisation).hypot(possible_shift),
            Parameter::Alpha(_) | Parameter::Law(_) => {
                value + side * (end - value).hypot(discretisation).hypot(possible_shift)
            }
        }
    };
    [low.map(|end| moved(-1.0, end)), high.map(|end| moved(1.0, end))]
}

/// The change of ln |μ| that a relative change of μ stands for. One of more than the modulus itself is a multiple of it
/// and no power: beyond 1 the factor grows as the change.
fn as_factor(relative: f64) -> f64 {
    if relative > 1.0 { 1.0 + relative.ln() } else { relative }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn interval_95(parameter: Parameter, value: f64, sd: f64, possible_shift: f64) -> [f64; 2] {
        let ends = linear_ends(parameter, value, sd).map(Some);
        widened(parameter, value, ends, 0.0, possible_shift).map(Option::unwrap)
    }

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
        // Meshes that leave ten times the modulus open leave some ten times of it, and no power of e.
        let [low, high] = widened(Parameter::Mu(0), 1.0, [Some(1.0); 2], 10.0 * sd, 0.0).map(Option::unwrap);
        assert!((high / (10.0 * std::f64::consts::E) - 1.0).abs() < 1e-12 && (low * high - 1.0).abs() < 1e-12);
        // What the meshes add is as if the scatter were larger; an open side stays open.
        for parameter in [Parameter::Kappa, Parameter::Mu(1), Parameter::Alpha(0)] {
            let ends = linear_ends(parameter, -2.0, 0.3 * sd).map(Some);
            let both = widened(parameter, -2.0, ends, 0.4 * sd, 0.0).map(Option::unwrap);
            let whole = linear_ends(parameter, -2.0, 0.5 * sd);
            assert!((0..2).all(|i| (both[i] / whole[i] - 1.0).abs() < 1e-12), "{both:?} {whole:?}");
            assert_eq!(widened(parameter, -2.0, [None, ends[1]], 0.4 * sd, 0.0), [None, Some(both[1])]);
        }
    }
}
