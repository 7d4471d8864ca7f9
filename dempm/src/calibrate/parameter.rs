//! Free parameters and their priors.

use dem::Grains;
use serde::Deserialize;

/// Keys of `[grains]` that can be free.
pub(super) const KEYS: [&str; 8] = [
    "friction",
    "rolling_friction",
    "rolling_stiffness",
    "normal_stiffness",
    "tangential_stiffness",
    "damping_ratio",
    "preparation_friction",
    "grain_density",
];

/// What is thought of a parameter before the tests, within its range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Prior {
    /// All values alike.
    #[default]
    Uniform,
    /// All orders of magnitude alike.
    LogUniform,
    /// A normal distribution.
    Normal {
        /// Its mean.
        mean: f64,
        /// Its standard deviation.
        sd: f64,
    },
}

/// A free parameter. Inversion works with a standard normal variable in its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Free {
    /// Key of `[grains]`.
    pub key: String,
    /// Smallest and largest value.
    pub range: [f64; 2],
    /// Prior within the range.
    pub prior: Prior,
}

/// Standard normal variables beyond this have no probability.
const FARTHEST: f64 = 6.0;

impl Free {
    /// The value that a standard normal variable stands for.
    pub fn value(&self, u: f64) -> f64 {
        let [low, high] = self.range;
        let below = |u: f64| 0.5 * (1.0 + libm::erf(u / std::f64::consts::SQRT_2));
        match self.prior {
            Prior::Uniform => low + (high - low) * below(u),
            Prior::LogUniform => low * (high / low).powf(below(u)),
            Prior::Normal { mean, sd } => (mean + sd * u).clamp(low, high),
        }
    }

    /// The value on the scale of its prior, from -1 to 1 over the range: what grains do changes smoothly with it, also
    /// where it comes to an end of its range.
    pub fn coordinate(&self, u: f64) -> f64 {
        match self.prior {
            Prior::Uniform | Prior::LogUniform => libm::erf(u / std::f64::consts::SQRT_2),
            Prior::Normal { .. } => {
                let [low, high] = self.range;
                (2.0 * self.value(u) - low - high) / (high - low)
            }
        }
    }

    /// Unit of the value; empty for a number.
    pub fn unit(&self) -> &'static str {
        match self.key.as_str() {
            "normal_stiffness" | "tangential_stiffness" | "rolling_stiffness" => "N/m",
            "grain_density" => "kg/m³",
            _ => "",
        }
    }

    /// The standard normal variable of a value, by bisection.
    pub fn normal(&self, value: f64) -> f64 {
        let (mut low, mut high) = (-FARTHEST, FARTHEST);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            *(if self.value(middle) < value { &mut low } else { &mut high }) = middle;
        }
        0.5 * (low + high)
    }

    /// What is wrong with it.
    pub(super) fn problem(&self) -> Option<String> {
        let [low, high] = self.range;
        if !KEYS.contains(&self.key.as_str()) {
            return Some(format!("`{}` cannot be free; {} can", self.key, KEYS.join(", ")));
        }
        if !(low < high && low.is_finite() && high.is_finite() && low >= 0.0) {
            return Some(format!("the range of `{}` must rise from 0 or more", self.key));
        }
        match self.prior {
            Prior::LogUniform if low == 0.0 => {
                Some(format!("a log-uniform prior of `{}` needs a range above 0", self.key))
            }
            Prior::Normal { mean, sd } if !(sd > 0.0 && (low..=high).contains(&mean)) => {
                Some(format!("the prior of `{}` needs sd > 0 and a mean in its range", self.key))
            }
            _ => None,
        }
    }
}

/// The grains with these values of the free parameters.
pub(super) fn with(grains: &Grains, free: &[Free], values: &[f64]) -> Grains {
    let mut grains = grains.clone();
    for (free, &value) in free.iter().zip(values) {
        let place = match free.key.as_str() {
            "friction" => &mut grains.friction,
            "rolling_friction" => &mut grains.rolling_friction,
            "rolling_stiffness" => &mut grains.rolling_stiffness,
            "normal_stiffness" => &mut grains.normal_stiffness,
            "tangential_stiffness" => &mut grains.tangential_stiffness,
            "damping_ratio" => &mut grains.damping_ratio,
            "preparation_friction" => &mut grains.preparation_friction,
            _ => &mut grains.grain_density,
        };
        *place = value;
    }
    grains
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_and_normal_variables_belong_together() {
        for prior in [Prior::Uniform, Prior::LogUniform, Prior::Normal { mean: 0.4, sd: 0.1 }] {
            let free = Free { key: "friction".into(), range: [0.1, 0.9], prior };
            assert_eq!(free.problem(), None);
            for u in [-2.0, -0.3, 0.0, 1.7] {
                assert!((free.normal(free.value(u)) - u).abs() < 1e-9, "{prior:?} {u}");
            }
            for (value, end) in [(0.1, -1.0), (0.9, 1.0)] {
                assert!((free.coordinate(free.normal(value)) - end).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn every_key_that_can_be_free_changes_the_grains() {
        for key in KEYS {
            let free = Free { key: key.into(), range: [0.0, 1.0], prior: Prior::Uniform };
            let changed =
                toml::Table::try_from(with(&Grains::default(), &[free], &[0.123])).unwrap();
            assert_eq!(changed[key].as_float(), Some(0.123));
        }
    }
}
