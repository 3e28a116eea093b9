//! Times as progress tells them.

use std::time::Duration;

/// Time left at the mean speed at which `computed` were done in `elapsed`; `None` where that says nothing.
pub(super) fn time_left(computed: usize, left: usize, elapsed: Duration) -> Option<Duration> {
    (computed > 0 && left > 0).then(|| elapsed.mul_f64(left as f64 / computed as f64))
}

/// A time in whole seconds, or in hours and minutes.
pub(super) fn words(time: Duration) -> String {
    let s = time.as_secs_f64().round() as u64;
    match (s / 3600, s / 60 % 60, s % 60) {
        (0, 0, s) => format!("{s} s"),
        (0, m, s) => format!("{m} min {s} s"),
        (h, m, _) => format!("{h} h {m} min"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_counts_this_run_alone() {
        assert_eq!(time_left(0, 5, Duration::from_secs(3)), None);
        assert_eq!(time_left(10, 5, Duration::from_secs(30)), Some(Duration::from_secs(15)));
        assert_eq!(words(Duration::from_secs(3725)), "1 h 2 min");
    }
}
