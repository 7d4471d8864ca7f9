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
    /// Names of networks that are left out, as the scene lies outside of their training data.
    pub outside: Vec<String>,
    /// Number of seeds of the truth.
    pub seeds: usize,
    /// Errors between two seeds of the truth.
    pub floor: Error,
    /// Front of 99 % of the mass of the truth at the end, m.
    pub front: f64,
    /// How far this front moves, m.
    pub runout: f64,
}

impl Sweep {
    /// The comparison that shows most of the truth: with all seeds, up to the end, on the finest squares.
    pub fn with_truth(&self) -> Option<&Comparison> {
        with_truth(&self.measured)
    }
}

/// As [`Sweep::with_truth`].
pub(super) fn with_truth(measured: &[Measured]) -> Option<&Comparison> {
    let all = measured.iter().filter_map(|m| m.comparison.as_ref());
    all.min_by(|a, b| {
        let size = |found: &Comparison| (found.seeds, found.rows.len());
        size(b).cmp(&size(a)).then(a.side.total_cmp(&b.side))
    })
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
    pub(super) fn is_outside_of_training(&self) -> bool {
        !self.family.is_solver() && self.warnings.contains("outside the training data")
    }

    /// Time and one measure of the error, which is infinite if the setting failed.
    pub fn cost(&self, measure: fn(&Error) -> f64) -> Cost {
        let error = self.error.as_ref().map_or(f64::INFINITY, measure);
        Cost { seconds: self.seconds, error }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::truth::{Row, Seeds};

    #[test]
    fn errors_are_means_over_time_and_differences_at_the_end() {
        let row = |time: f64, distance: f64| Row {
            time,
            distance,
            spread: Some(0.1 * distance),
            misplaced: 0.2 * time,
            misplaced_spread: Some(0.02),
            front: 1.5,
            true_front: Seeds { mean: 2.0 * time, deviation: Some(0.03) },
            connected_front: None,
            true_connected_front: None,
            centre: [0.0; 2],
            true_centre: [Seeds { mean: 0.0, deviation: None }; 2],
            kinetic_energy: 0.0,
            true_kinetic_energy: Seeds { mean: 0.0, deviation: None },
        };
        let found = Comparison {
            name: String::new(),
            side: 0.0625,
            seeds: 2,
            rows: vec![row(0.5, 3.0), row(1.0, 4.0)],
            counted_from: 0.5,
            arrest: None,
            true_arrest: None,
            failure: None,
        };
        let error = Error::of(&found).unwrap();
        assert!((error.distance - 12.5_f64.sqrt()).abs() < 1e-12);
        assert_eq!((error.front, error.misplaced), (0.5, 0.2));
        let floor = Error::between_seeds(&found).unwrap();
        assert!((floor.distance - 0.125_f64.sqrt()).abs() < 1e-12);
        assert_eq!((floor.front, floor.misplaced), (0.03, 0.02));
    }
}
