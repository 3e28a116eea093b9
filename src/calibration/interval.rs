//! Intervals of 95 % from standard deviations.

use crate::material::Parameter;

/// The interval of a parameter about its estimate, where 1.96 standard deviations are `half_width`.
///
/// κ and the moduli of Ogden's terms keep their sign. Where they are hardly known it is their logarithm that scatters
/// like a Gaussian: an estimate that comes out low promises a standard deviation lower by the same factor, so that
/// symmetric intervals about low estimates are too short. Their intervals are symmetric in the logarithm, which changes
/// nothing where the standard deviation is small.
pub(super) fn interval_95(parameter: Parameter, value: f64, half_width: f64) -> [f64; 2] {
    let is_a_scale = matches!(parameter, Parameter::Kappa | Parameter::Mu(_)) && value != 0.0;
    let mut ends = [-1.0, 1.0].map(|side| match is_a_scale {
        true => value * (side * half_width / value.abs()).exp(),
        false => value + side * half_width,
    });
    if ends[0] > ends[1] {
        ends.reverse();
    }
    ends
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_keep_their_sign_and_exponents_are_symmetric() {
        let [low, high] = interval_95(Parameter::Mu(0), 2.0, 1.0);
        // Symmetric in the logarithm, to rounding.
        assert!((low * high - 4.0).abs() < 1e-14 && (high / 2.0 - 0.5f64.exp()).abs() < 1e-15);
        let negative = interval_95(Parameter::Mu(1), -2.0, 1.0);
        assert_eq!(negative, [-high, -low]);
        assert_eq!(interval_95(Parameter::Alpha(0), 2.0, 3.0), [-1.0, 5.0]);
        // Of a small standard deviation both are the same, to its square.
        let [low, high] = interval_95(Parameter::Kappa, 1.0, 1e-3);
        assert!((low - 0.999).abs() < 1e-6 && (high - 1.001).abs() < 1e-6);
        assert_eq!(interval_95(Parameter::Mu(0), 0.0, 1.0), [-1.0, 1.0]);
    }
}
