//! The cost and the error of a setting.

use serde::{Deserialize, Serialize};

use crate::models::Model;
use crate::studies::pareto::Cost;

/// A kind of method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Family {
    /// A packing in every point.
    Packings,
    /// The mu(I) law.
    Continuum,
    /// A learned simulator.
    Network,
    /// A network of the paper's ablation, trained to be compared with the others.
    Ablation,
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
    /// Wall time of the computation, s, without preparing packings, kernels and files; the median of
    /// repeated times.
    pub seconds: f64,
    /// Largest difference between repeated times, s.
    #[serde(default)]
    pub spread: Option<f64>,
    /// Errors; `None` if it failed.
    pub error: Option<Error>,
    /// Why it failed, in the program's words.
    pub failure: String,
    /// Device that it ran on.
    pub device: String,
    /// Processor time of the whole program, s.
    pub processor_seconds: Option<f64>,
    /// Load average per core at its end.
    pub load: Option<f64>,
}

/// Errors against the reference: means of those against its two seeds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Error {
    /// Mean square distance of points over all frames, box width 1.
    pub mse: f64,
    /// Position of the front at the end, m.
    pub front: f64,
    /// Root mean square over the height profile at the end, m.
    pub height: f64,
    /// Root mean square distance of points over all frames, m.
    pub distance: f64,
}

/// A case with the results of all settings.
pub struct Sweep {
    /// The settings; the reference comes first.
    pub measured: Vec<Measured>,
    /// Difference between the two seeds of the reference.
    pub floor: Error,
    /// Wall times of the two, s, whose difference shows how uncertain times are.
    pub reference_seconds: [f64; 2],
    /// Position of the reference's front at the end, m.
    pub front: f64,
    /// How far the front moves, m.
    pub runout: f64,
    /// Height of the column, m.
    pub height: f64,
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
    Measure { name: "MSE of points", unit: "box²", value: |error| error.mse },
    Measure { name: "front", unit: "m", value: |error| error.front },
    Measure { name: "height profile", unit: "m", value: |error| error.height },
];

impl Measured {
    /// Time and one measure of the error, which is infinite if the setting failed.
    pub fn cost(&self, measure: fn(&Error) -> f64) -> Cost {
        let error = self.error.as_ref().map_or(f64::INFINITY, measure);
        Cost { seconds: self.seconds, error }
    }
}
