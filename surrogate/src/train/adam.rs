//! Adam (Kingma, Ba, 2015), without weight decay.

use serde::{Deserialize, Serialize};

const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.999;
const EPSILON: f32 = 1e-8;

/// The optimiser with its moving averages.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Adam {
    steps: u64,
    /// Moving average of the gradient.
    mean: Vec<f32>,
    /// Moving average of its square.
    square: Vec<f32>,
}

impl Adam {
    /// The optimiser of `count` weights.
    pub fn new(count: usize) -> Self {
        Self { steps: 0, mean: vec![0.0; count], square: vec![0.0; count] }
    }

    /// The number of weights.
    pub fn len(&self) -> usize {
        self.mean.len().min(self.square.len())
    }

    /// Steps made, and the moving averages of the gradient and of its square.
    pub fn parts(&self) -> (u64, &[f32], &[f32]) {
        (self.steps, &self.mean, &self.square)
    }

    /// The inverse of [`parts`](Self::parts).
    pub fn from_parts(steps: u64, mean: Vec<f32>, square: Vec<f32>) -> Self {
        Self { steps, mean, square }
    }

    /// Bias corrections 1 - beta^steps of the two averages, which start from zero.
    pub fn corrections(steps: u64) -> [f32; 2] {
        [BETA_1, BETA_2].map(|beta| (1.0 - beta.powf(steps as f64)) as f32)
    }

    /// Updates the weights with the learning rate `rate`.
    pub fn step(&mut self, weights: &mut [f32], gradients: &[f32], rate: f64) {
        self.steps += 1;
        let [mean_part, square_part] = Self::corrections(self.steps);
        let (beta_1, beta_2, rate) = (BETA_1 as f32, BETA_2 as f32, rate as f32);
        let averages = self.mean.iter_mut().zip(&mut self.square);
        for ((weight, &g), (mean, square)) in weights.iter_mut().zip(gradients).zip(averages) {
            *mean = beta_1 * *mean + (1.0 - beta_1) * g;
            *square = beta_2 * *square + (1.0 - beta_2) * g * g;
            *weight -= rate * (*mean / mean_part) / ((*square / square_part).sqrt() + EPSILON);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_steps_are_as_long_as_the_rate_and_a_bowl_is_descended() {
        let mut weights = vec![1.0_f32, -2.0];
        let mut adam = Adam::new(2);
        let gradient = |w: &[f32]| vec![2.0 * w[0], 20.0 * w[1]];
        let first = gradient(&weights);
        adam.step(&mut weights, &first, 0.01);
        assert!((weights[0] - 0.99).abs() < 1e-6 && (weights[1] + 1.99).abs() < 1e-6);
        for _ in 0..2000 {
            let gradient = gradient(&weights);
            adam.step(&mut weights, &gradient, 0.01);
        }
        assert!(weights.iter().all(|w| w.abs() < 1e-3), "{weights:?}");
    }
}
