//! Finite rotations by a rotation vector.

/// R x − x for the rotation by the vector `w` (its length the angle in rad, its direction the axis): Rodrigues'
/// formula, R x − x = sin(θ)/θ w×x + (1 − cos θ)/θ² w×(w×x).
pub(super) fn turning_of(w: [f64; 3], x: [f64; 3]) -> [f64; 3] {
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    // Both factors by their series near zero.
    let square: f64 = w.iter().map(|x| x * x).sum();
    let (a, b) = if square < 1e-8 {
        (1.0 - square / 6.0, 0.5 - square / 24.0)
    } else {
        let angle = square.sqrt();
        (angle.sin() / angle, (1.0 - angle.cos()) / square)
    };
    let once = cross(w, x);
    let twice = cross(w, once);
    [0, 1, 2].map(|i| a * once[i] + b * twice[i])
}

/// R x for the rotation by the vector `w`, rad. The inverse turns by −`w`.
pub fn turned_by(w: [f64; 3], x: [f64; 3]) -> [f64; 3] {
    let by = turning_of(w, x);
    [0, 1, 2].map(|i| x[i] + by[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A right angle, an angle within the series, and the way back.
    #[test]
    fn vectors_turn_about_the_axis() {
        let turned = turned_by([0.0, 0.0, std::f64::consts::FRAC_PI_2], [2.0, 0.0, 1.0]);
        // Rounding.
        assert!(turned.iter().zip([0.0, 2.0, 1.0]).all(|(a, b)| (a - b).abs() < 1e-15), "{turned:?}");
        for size in [1e-5, 0.3] {
            let (w, x) = ([0.6 * size, -0.3 * size, 0.9 * size], [1.0, 2.0, -3.0]);
            let back = turned_by(w.map(|a| -a), turned_by(w, x));
            assert!(back.iter().zip(x).all(|(a, b)| (a - b).abs() < 1e-14), "{back:?}");
        }
    }
}
