//! The cost and the error of a setting.

use serde::{Deserialize, Serialize};

use crate::models::Model;
use crate::studies::pareto::Cost;
use crate::truth::Comparison;

/// A kind of method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Family {
    /// Every grain as a disc: the truth.
    Discs,
    /// Larger discs.
    CoarserDiscs,
    /// A packing in every point.
    Packings,
    /// The mu(I) law.
    Continuum,
    /// A learned simulator.
    Network,
    /// A network of the paper's ablation, trained to be compared with the others.
    Ablation,
}

impl Family {
    /// Whether it solves equations of motion.
    pub fn is_solver(self) -> bool {
        !matches!(self, Self::Network | Self::Ablation)
    }
}

/// A setting of a method with its cost and error.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Measured {
    /// Kind of the method.
    pub family: Family,
    /// Name of the setting.
    pub name: String,
    /// The model, if it is a network.
    #[serde(skip)]
    pub model: Option<Model>,
    /// Wall time of the computation, s, without preparing packings, columns of discs, kernels and files; the
    /// median of repeated times. NaN if it failed.
    #[serde(deserialize_with = "number_or_nan")]
    pub seconds: f64,
    /// Largest difference between repeated times, s.
    #[serde(default)]
    pub spread: Option<f64>,
    /// Comparison with the truth, as far as it got; `None` if it did not begin.
    pub comparison: Option<Comparison>,
    /// Errors; `None` if it failed.
    pub error: Option<Error>,
    /// Why it failed, in the program's words.
    pub failure: String,
    /// The program's warnings, such as those of a network outside of its training data.
    pub warnings: String,
    /// Device that it ran on.
    pub device: String,
    /// Processor time of the whole program, s.
    pub processor_seconds: Option<f64>,
    /// Load average per core at its end.
    pub load: Option<f64>,
}

/// JSON has no NaN: it is written as null.
fn number_or_nan<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

/// Errors against the truth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Error {
    /// Root mean square distance of squares of material, over all frames, m.
    pub distance: f64,
    /// Distance of the front of 99 % of the mass from the mean of the seeds at the end, m.
    pub front: f64,
    /// Share of the mass misplaced at the end.
    pub misplaced: f64,
}

impl Error {
    /// The errors of a comparison; `None` without rows.
    pub fn of(found: &Comparison) -> Option<Self> {
        let last = found.rows.last()?;
        Some(Self {
            distance: root_mean_square(found.rows.iter().map(|row| row.distance)),
            front: (last.front - last.true_front.mean).abs(),
            misplaced: last.misplaced,
        })
    }

    /// The same between two seeds of the truth; of the front, the standard deviation. `None` of one seed.
    pub fn between_seeds(found: &Comparison) -> Option<Self> {
        let last = found.rows.last()?;
        let spreads: Option<Vec<f64>> = found.rows.iter().map(|row| row.spread).collect();
        Some(Self {
            distance: root_mean_square(spreads?),
            front: last.true_front.deviation?,
            misplaced: last.misplaced_spread?,
        })
    }
}

fn root_mean_square(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = values.into_iter().fold((0.0, 0.0), |(sum, n), x| (sum + x * x, n + 1.0));
    (sum / count).sqrt()
}

/// A case with the results of all settings.
pub struct Sweep {
    /// The settings; the truth itself comes first.
    pub measured: Vec<Measured>,
    /// Number of seeds of the truth.
    pub seeds: usize,
    /// Errors between two seeds of the truth.
    pub floor: Error,
    /// Front of 99 % of the mass of the truth at the end, m.
    pub front: f64,
    /// How far this front moves, m.
    pub runout: f64,
}

/// A measure of error.
pub struct Measure {
    /// Its name.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Its value.
    pub value: fn(&Error) -> f64,
}

/// The measures of the speed-accuracy charts.
pub const MEASURES: [Measure; 3] = [
    Measure { name: "distance of points", unit: "m", value: |error| error.distance },
    Measure { name: "front", unit: "m", value: |error| error.front },
    Measure { name: "mass misplaced", unit: "share", value: |error| error.misplaced },
];

impl Measured {
    /// Whether it is a network and the scene lies outside of its training data.
    pub fn is_outside_of_training(&self) -> bool {
        !self.family.is_solver() && self.warnings.contains("outside the training data")
    }

    /// Time and one measure of the error, which is infinite if the setting failed.
    pub fn cost(&self, measure: fn(&Error) -> f64) -> Cost {
        let error = self.error.as_ref().map_or(f64::INFINITY, measure);
        Cost { seconds: self.seconds, error }
    }
}
