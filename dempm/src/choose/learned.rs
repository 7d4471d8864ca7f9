//! A learned model as a candidate.
//!
//! Networks are in another crate, which builds on this one: whoever has loaded one says what to expect of it.

use serde::{Deserialize, Serialize};

use super::candidate::Candidate;
use super::error_model::{Expected, Prediction};
use super::family::Family;
use crate::scene::Scene;

/// Relative tolerance on equal times.
const ROUNDING: f64 = 1e-6;

/// What a learned model says of a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Learned {
    /// Its name in tables.
    pub name: String,
    /// The scene that it predicts: its grains as discs, averaged over squares as in training (TOML).
    pub scene: String,
    /// Time between its frames (s): a multiple of that of the scene, unless it is `out`.
    pub frame_interval: f64,
    /// The distance (m) from the discs to expect; `None` if it has not been predicted.
    pub error: Option<LearnedError>,
    /// Wall time of the prediction with its first frames (s).
    pub seconds: Option<f64>,
    /// Memory of the program (bytes), where the system tells.
    pub memory: Option<f64>,
    /// Why it cannot be taken.
    pub out: Option<String>,
}

/// The error to expect of a learned model.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearnedError {
    /// At the end.
    pub end: Expected,
    /// The largest over time.
    pub largest: Expected,
}

impl Learned {
    /// Leaves it out where all frames have to be `interval` (s) apart and its own are further.
    pub fn with_frames(mut self, interval: f64) -> Self {
        let own = self.frame_interval;
        if own > interval * (1.0 + ROUNDING) {
            let why =
                || format!("its frames are {own} s apart, those of the data set {interval} s");
            self.out.get_or_insert_with(why);
        }
        self
    }

    /// The candidate of the scene called `scene`.
    pub(super) fn candidate(&self, scene: &str) -> Candidate {
        let scene = Scene::parse(&self.scene, scene).map(Box::new);
        Candidate {
            family: Family::Learned,
            name: self.name.clone(),
            size: 1.0,
            cell: scene.as_ref().map_or(f64::NAN, |scene| scene.domain.cell),
            packings: None,
            scene: scene.map_err(|error| error.to_string()),
        }
    }

    /// What it expects of itself.
    pub(super) fn prediction(&self) -> Option<Prediction> {
        let LearnedError { end, largest } = self.error?;
        Some(Prediction { end, largest, beyond: Vec::new() })
    }
}
