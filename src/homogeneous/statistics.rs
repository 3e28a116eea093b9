//! The few distributions that curve fits need: F, Student's t, the normal.

/// Lanczos coefficients, g = 7, nine terms (Godfrey 2001): relative error below 1e-14 for positive arguments.
const LANCZOS: [f64; 9] = [
    0.999_999_999_999_809_9,
    676.520_368_121_885_1,
    -1_259.139_216_722_402_8,
    771.323_428_777_653_1,
    -176.615_029_162_140_6,
    12.507_343_278_686_905,
    -0.138_571_095_265_720_12,
    9.984_369_578_019_572e-6,
    1.505_632_735_149_311_6e-7,
];

/// ln Γ(x) for x > 0.
fn ln_gamma(x: f64) -> f64 {
    if x < 0.5 {
        return (std::f64::consts::PI / (std::f64::consts::PI * x).sin()).ln() - ln_gamma(1.0 - x);
    }
    let x = x - 1.0;
    let base = x + 7.5;
    let sum = LANCZOS[1..].iter().enumerate().fold(LANCZOS[0], |s, (i, c)| s + c / (x + i as f64 + 1.0));
    0.5 * (2.0 * std::f64::consts::PI).ln() + (x + 0.5) * base.ln() - base + sum.ln()
}

/// The regularised incomplete beta function I_x(a, b), by its continued fraction (DLMF 8.17.22).
fn incomplete_beta(x: f64, a: f64, b: f64) -> f64 {
    if !(x > 0.0) {
        return 0.0;
    }
    if x >= 1.0 {
        return 1.0;
    }
    // The fraction converges fast below the mean of the distribution; above it, use the mirror image.
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - incomplete_beta(1.0 - x, b, a);
    }
    let front = (ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b) + a * x.ln() + b * (-x).ln_1p()).exp() / a;
    // Modified Lentz: numerator and denominator ratios kept away from zero.
    const TINY: f64 = 1e-300;
    let guard = |v: f64| if v.abs() < TINY { TINY } else { v };
    let (mut c, mut d) = (1.0, 1.0 / guard(1.0 - (a + b) * x / (a + 1.0)));
    let mut fraction = d;
    for m in 1..500 {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        for term in [even, odd] {
            d = 1.0 / guard(1.0 + term * d);
            c = guard(1.0 + term / c);
            fraction *= c * d;
        }
        if (c * d - 1.0).abs() < 1e-15 {
            break;
        }
    }
    front * fraction
}

/// Probability that an F variable with (`numerator`, `denominator`) degrees of freedom exceeds `value`. 1 for a value
/// that is not positive, NaN for degrees of freedom that are not.
pub fn f_exceedance(value: f64, numerator: f64, denominator: f64) -> f64 {
    if !(numerator > 0.0 && denominator > 0.0) || value.is_nan() {
        return f64::NAN;
    }
    if value <= 0.0 {
        return 1.0;
    }
    incomplete_beta(denominator / (denominator + numerator * value), 0.5 * denominator, 0.5 * numerator)
}

/// The two-sided quantile of Student's t: |t| exceeds it with probability `tail`. Infinite without degrees of freedom.
pub fn t_quantile(tail: f64, degrees_of_freedom: f64) -> f64 {
    if !(degrees_of_freedom > 0.0) {
        return f64::INFINITY;
    }
    let exceedance =
        |t: f64| incomplete_beta(degrees_of_freedom / (degrees_of_freedom + t * t), 0.5 * degrees_of_freedom, 0.5);
    let (mut low, mut high) = (0.0, 1.0);
    while exceedance(high) > tail && high < 1e12 {
        high *= 2.0;
    }
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if exceedance(middle) > tail { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The error function. Maclaurin series below 2, continued fraction of erfc above (DLMF 7.6.2, 7.9.1).
pub fn erf(x: f64) -> f64 {
    let a = x.abs();
    let value = if a < 2.0 {
        // erf x = 2/√π e^(−x²) Σ 2ⁿ x^(2n+1)/(2n+1)!!: all terms positive.
        let (mut term, mut sum) = (a, a);
        for n in 1..200 {
            term *= 2.0 * a * a / (2.0 * f64::from(n) + 1.0);
            sum += term;
            if term < 1e-17 * sum {
                break;
            }
        }
        std::f64::consts::FRAC_2_SQRT_PI * (-a * a).exp() * sum
    } else if a < 6.0 {
        // Evaluated from the far end; 60 levels reach rounding at 2.
        let tail = (1..=60).rev().fold(a, |below, k| a + 0.5 * f64::from(k) / below);
        1.0 - (-a * a).exp() / (std::f64::consts::PI.sqrt() * tail)
    } else {
        1.0
    };
    value.copysign(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tables of the distributions, to the digits printed there.
    #[test]
    fn known_quantiles() {
        for (value, a, b, p) in [(4.9646, 1.0, 10.0, 0.05), (3.0984, 3.0, 20.0, 0.05), (6.2265, 2.0, 15.0, 0.0107)] {
            assert!((f_exceedance(value, a, b) - p).abs() < 1e-4, "{value} {a} {b}: {}", f_exceedance(value, a, b));
        }
        for (dof, t) in [(1.0, 12.7062), (5.0, 2.5706), (30.0, 2.0423), (1e6, 1.95997)] {
            assert!((t_quantile(0.05, dof) - t).abs() < 1e-4, "{dof}: {}", t_quantile(0.05, dof));
        }
    }

    /// Abramowitz and Stegun, table 7.1, ten digits.
    #[test]
    fn error_function() {
        for (x, value) in
            [(0.0, 0.0), (0.5, 0.520_499_877_8), (1.0, 0.842_700_792_9), (1.9, 0.992_790_429_2), (2.1, 0.997_020_533_3)]
        {
            assert!((erf(x) - value).abs() < 1e-10, "{x}: {}", erf(x));
            assert!((erf(-x) + value).abs() < 1e-10);
        }
        // The two branches meet: their difference over 2e-9 is the slope 0.0207 times that.
        assert!((erf(2.0 + 1e-9) - erf(2.0 - 1e-9)).abs() < 1e-10);
    }
}
