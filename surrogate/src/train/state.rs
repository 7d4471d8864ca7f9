//! Everything that changes in training.

use serde::{Deserialize, Serialize};

use super::optimiser::Moments;

/// State of a training, the same on every device; part of a checkpoint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// All weights, in the order of [`parameters`](crate::network::parameters).
    pub weights: Vec<f32>,
    /// The optimiser's moving averages.
    pub moments: Moments,
    /// Moving average of the weights, if it is taken.
    pub average: Option<Vec<f32>>,
    /// Steps made.
    pub step: u64,
}

impl State {
    /// The state before the first step, with these weights.
    pub fn new(weights: Vec<f32>, averaging: bool) -> Self {
        let moments = Moments::new(weights.len());
        let average = averaging.then(|| weights.clone());
        Self { weights, moments, average, step: 0 }
    }

    /// Hash by which processes compare their states.
    pub fn hash(&self) -> [u8; 32] {
        let bytes = postcard::to_allocvec(self).expect("a state is plain data");
        *blake3::hash(&bytes).as_bytes()
    }
}
