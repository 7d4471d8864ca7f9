//! How near to the truth a result is to be.

use std::str::FromStr;

use serde::Serialize;

/// The value of `--within`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Within {
    /// A root mean square distance (m).
    Metres(f64),
    /// A share of the run-out.
    OfRunout(f64),
}

impl FromStr for Within {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (number, unit): (&str, fn(f64) -> Self) = match text.strip_suffix('%') {
            Some(percent) => (percent, |value| Self::OfRunout(0.01 * value)),
            None => (text.strip_suffix('m').unwrap_or(text), Self::Metres),
        };
        let positive = |value: &f64| value.is_finite() && *value > 0.0;
        let value = number.trim().parse().ok().filter(positive);
        value
            .map(unit)
            .ok_or_else(|| "a distance in metres such as 0.1, or 5% of the run-out".into())
    }
}

impl Within {
    /// The distance (m) on a scene whose front is expected to move by `runout` (m); `None` without a run-out.
    pub fn metres(self, runout: Option<f64>) -> Option<f64> {
        match self {
            Self::Metres(distance) => Some(distance),
            Self::OfRunout(share) => runout.map(|runout| share * runout),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metres_and_shares() {
        assert_eq!("0.1".parse(), Ok(Within::Metres(0.1)));
        assert_eq!("0.1 m".parse(), Ok(Within::Metres(0.1)));
        assert_eq!("5%".parse(), Ok(Within::OfRunout(0.05)));
        assert_eq!(Within::OfRunout(0.05).metres(Some(2.0)), Some(0.1));
        assert_eq!(Within::OfRunout(0.05).metres(None), None);
        for wrong in ["", "0", "-1", "inf", "x", "%", "5 %%"] {
            assert!(wrong.parse::<Within>().is_err(), "{wrong}");
        }
    }
}
