//! One number of a result, and how its change is judged.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Which way is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Larger magnitude: integrated sensitivities, gains.
    LargerIsBetter,
    /// Smaller: standard deviations.
    SmallerIsBetter,
    /// Neither: forces, stretches, counts.
    Neutral,
}

/// A number of a result.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Where it stands, such as `drive 5 mm: sum of mu_1`; unique within a result.
    pub name: String,
    /// Its value; none where the result says null.
    pub value: Option<f64>,
    /// Which way is better.
    pub direction: Direction,
}

/// What became of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Judgement {
    /// Within the tolerance.
    Same,
    /// Better by more than the tolerance.
    Better,
    /// Changed by more than the tolerance, where no way is better.
    Changed,
    /// Worse by more than the tolerance.
    Worse,
}

/// A figure in both results.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// Where it stands.
    pub figure: String,
    /// Value in the base.
    pub base: Option<f64>,
    /// Value in the current result.
    pub current: Option<f64>,
    /// current / base − 1 in magnitude; null where a value is missing or the base is zero.
    pub relative_change: Option<f64>,
    /// Which way is better.
    pub direction: Direction,
    /// What became of it.
    pub judgement: Judgement,
}

impl Line {
    /// Judges a figure. Signs are compared too: a figure that changes its sign is never the same or better.
    pub fn new(base: &Figure, current: Option<f64>, relative_tolerance: f64) -> Line {
        let relative_change = match (base.value, current) {
            // 0 → 0 is no change, 0 → anything has no relative one.
            (Some(b), Some(c)) if b.abs() > 0.0 => Some((c - b) / b),
            _ => None,
        };
        let judgement = match (base.value, current) {
            (None, None) => Judgement::Same,
            // A standard deviation that is no longer determined is the worst; one that now is, an improvement.
            (Some(_), None) => Judgement::Worse,
            (None, Some(_)) => Judgement::Better,
            (Some(b), Some(c)) => judge(b, c, base.direction, relative_tolerance),
        };
        Line {
            figure: base.name.clone(),
            base: base.value,
            current,
            relative_change,
            direction: base.direction,
            judgement,
        }
    }
}

fn judge(base: f64, current: f64, direction: Direction, relative_tolerance: f64) -> Judgement {
    if !(base.is_finite() && current.is_finite()) {
        return if base.to_bits() == current.to_bits() { Judgement::Same } else { Judgement::Worse };
    }
    if (current - base).abs() <= relative_tolerance * base.abs() {
        return Judgement::Same;
    }
    let grew = current.abs() > base.abs();
    let is_flipped = base * current < 0.0;
    match direction {
        Direction::Neutral => Judgement::Changed,
        _ if is_flipped => Judgement::Worse,
        Direction::LargerIsBetter if grew => Judgement::Better,
        Direction::SmallerIsBetter if !grew => Judgement::Better,
        _ => Judgement::Worse,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(direction: Direction, base: Option<f64>, current: Option<f64>) -> Judgement {
        // A tolerance of 1 %: values below differ by 10 % or by 0.1 %.
        Line::new(&Figure { name: "x".into(), value: base, direction }, current, 0.01).judgement
    }

    #[test]
    fn each_direction_is_judged_its_way() {
        use Direction::{LargerIsBetter as Larger, Neutral, SmallerIsBetter as Smaller};
        let (a, up, near) = (Some(10.0), Some(11.0), Some(10.01));
        assert_eq!(judged(Larger, a, up), Judgement::Better);
        assert_eq!(judged(Larger, up, a), Judgement::Worse);
        assert_eq!(judged(Smaller, a, up), Judgement::Worse);
        assert_eq!(judged(Smaller, up, a), Judgement::Better);
        assert_eq!(judged(Neutral, a, up), Judgement::Changed);
        for direction in [Larger, Smaller, Neutral] {
            assert_eq!(judged(direction, a, near), Judgement::Same);
            assert_eq!(judged(direction, a, None), Judgement::Worse);
            assert_eq!(judged(direction, None, a), Judgement::Better);
            assert_eq!(judged(direction, None, None), Judgement::Same);
            assert_eq!(judged(direction, Some(0.0), Some(0.0)), Judgement::Same);
        }
    }

    /// S_α is negative where μ is: a larger magnitude is better, another sign is not.
    #[test]
    fn signs_count() {
        assert_eq!(judged(Direction::LargerIsBetter, Some(-10.0), Some(-12.0)), Judgement::Better);
        assert_eq!(judged(Direction::LargerIsBetter, Some(-10.0), Some(-8.0)), Judgement::Worse);
        assert_eq!(judged(Direction::LargerIsBetter, Some(-10.0), Some(30.0)), Judgement::Worse);
    }
}
