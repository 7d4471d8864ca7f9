//! Thresholds, by bisection or from a sweep.

use serde::{Deserialize, Serialize};

use crate::text::number;

/// The value of a parameter at which a method stops working, as far as it is known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Threshold {
    /// It works at the first value and not at the second.
    Between(f64, f64),
    /// It works up to the last value.
    Beyond(f64),
    /// It does not work at the first value.
    Before(f64),
}

impl Threshold {
    /// The geometric mean of the bracket; `None` if the change was not found.
    pub fn value(self) -> Option<f64> {
        match self {
            Self::Between(works, fails) => Some((works * fails).sqrt()),
            Self::Beyond(_) | Self::Before(_) => None,
        }
    }

    /// From outcomes in the order of the parameter: the first value that does not work.
    pub fn of_sweep(values: impl IntoIterator<Item = (f64, bool)>) -> Self {
        let mut last = None;
        for (value, works) in values {
            match (works, last) {
                (true, _) => last = Some(value),
                (false, Some(good)) => return Self::Between(good, value),
                (false, None) => return Self::Before(value),
            }
        }
        last.map_or(Self::Before(f64::NAN), Self::Beyond)
    }
}

impl std::fmt::Display for Threshold {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match *self {
            Self::Between(works, fails) => {
                let value = (works * fails).sqrt();
                let half = 0.5 * (fails - works).abs();
                if half < 0.05 * value.abs() {
                    write!(f, "{}", number(value))
                } else {
                    write!(f, "{} to {}", number(works), number(fails))
                }
            }
            Self::Beyond(value) => write!(f, "none up to {}", number(value)),
            Self::Before(value) => write!(f, "below {}", number(value)),
        }
    }
}

/// The value between `low` and `high` (both positive) at which `works` turns false, to a relative
/// `tolerance`, by bisection on a logarithmic scale. `works` is assumed to change once.
pub fn bisect(
    low: f64,
    high: f64,
    tolerance: f64,
    mut works: impl FnMut(f64) -> bool,
) -> Threshold {
    if !works(low) {
        return Threshold::Before(low);
    }
    if works(high) {
        return Threshold::Beyond(high);
    }
    let (mut good, mut bad) = (low, high);
    while bad / good > 1.0 + tolerance {
        let middle = (good * bad).sqrt();
        if works(middle) { good = middle } else { bad = middle }
    }
    Threshold::Between(good, bad)
}

/// `count` values from `low` to `high`, equally spaced on a logarithmic scale.
pub fn log_range(low: f64, high: f64, count: usize) -> Vec<f64> {
    let ratio = (high / low).powf(1.0 / (count - 1) as f64);
    (0..count).map(|k| low * ratio.powi(k as i32)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bisection_brackets_the_change() {
        let Threshold::Between(good, bad) = bisect(0.01, 100.0, 0.01, |x| x < 0.55) else {
            panic!("the change is inside")
        };
        assert!(good < 0.55 && 0.55 <= bad && bad / good <= 1.01);
        assert_eq!(bisect(1.0, 2.0, 0.1, |_| true), Threshold::Beyond(2.0));
        assert_eq!(bisect(1.0, 2.0, 0.1, |_| false), Threshold::Before(1.0));
    }

    #[test]
    fn a_sweep_brackets_too() {
        let sweep = |pattern: &[bool]| {
            Threshold::of_sweep(pattern.iter().enumerate().map(|(k, &ok)| (k as f64, ok)))
        };
        assert_eq!(sweep(&[true, true, false, true]), Threshold::Between(1.0, 2.0));
        assert_eq!(sweep(&[false, true]), Threshold::Before(0.0));
        assert_eq!(sweep(&[true, true]), Threshold::Beyond(1.0));
    }

    #[test]
    fn a_narrow_bracket_is_one_number() {
        assert_eq!(Threshold::Between(1.99, 2.01).to_string(), "2");
        assert_eq!(Threshold::Between(1.0, 2.0).to_string(), "1 to 2");
        assert_eq!(Threshold::Beyond(3.0).to_string(), "none up to 3");
    }
}
