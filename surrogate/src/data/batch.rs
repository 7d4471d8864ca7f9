//! Batches: what a model learns from in one step.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{DataError, DataSet, Order};
use crate::features::Normalisation;

/// Windows and what should follow, ready for the model.
#[derive(Clone, Debug, PartialEq)]
pub struct Batch {
    /// Positions of each window, m, frame after frame, the oldest first.
    pub windows: Vec<Vec<f32>>,
    /// Points of each window.
    pub points: Vec<usize>,
    /// Normalised accelerations of the points of all windows.
    pub targets: Vec<f32>,
}

/// How batches are made of windows.
#[derive(Clone, Debug)]
pub struct Recipe {
    /// Seed of order, noise and mirror images.
    pub seed: u64,
    /// Windows in a batch.
    pub batch: usize,
    /// Standard deviation of the noise on the last velocity, m/frame.
    pub noise: f64,
    /// Mirrors every other window, at random.
    pub mirror: bool,
    /// Learns accelerations relative to free fall.
    pub without_gravity: bool,
    /// The normalisation of the targets.
    pub normalisation: Normalisation,
}

impl Recipe {
    /// Makes the batch of a step. The same step always gives the same batch; `order` has to be
    /// that of `self.seed` and `data`.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn batch(&self, data: &DataSet, order: &mut Order, step: u64) -> Result<Batch, DataError> {
        let mut batch = Batch { windows: Vec::new(), points: Vec::new(), targets: Vec::new() };
        let [[_, width], _] = data.bounds();
        for member in 0..self.batch as u64 {
            let place = step * self.batch as u64 + member;
            let mut example = data.example(order.window(place))?;
            // Not the streams of the order, which has the seed itself.
            let mut rng = ChaCha8Rng::seed_from_u64(!self.seed);
            rng.set_stream(place);
            if self.mirror && rng.random() {
                example.mirror(width);
            }
            if self.noise > 0.0 {
                example.add_noise(self.noise, &mut rng);
            }
            let Normalisation { acceleration_mean, acceleration_std, .. } = &self.normalisation;
            let targets = example.acceleration().into_iter().enumerate().map(|(place, a)| {
                let axis = place % 2;
                let gravity = if self.without_gravity { example.gravity[axis] } else { 0.0 };
                ((a - gravity - acceleration_mean[axis]) / acceleration_std[axis]) as f32
            });
            batch.targets.extend(targets);
            batch.points.push(example.points);
            batch.windows.push(example.positions.iter().map(|&x| x as f32).collect());
        }
        Ok(batch)
    }
}
