//! Adam (Kingma, Ba, 2015), without weight decay, and Muon (Jordan et al., 2024) for hidden matrices.
//!
//! Muon steps along the orthogonal factor U V^T of the momentum M = U S V^T, so that all directions of a
//! matrix learn at the same pace, not only those with large gradients. A few Newton-Schulz iterations
//! approximate it: singular values become 0.7 to 1.2. The factor 0.2 sqrt(max(rows, columns)) makes
//! a step about as long as Adam's at the same learning rate (Liu et al., 2025).

use std::ops::Range;

use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::network::parameters::HiddenMatrix;

const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.999;
const EPSILON: f32 = 1e-8;

/// Decay of Muon's momentum.
const MUON_BETA: f32 = 0.95;
/// Newton-Schulz iterations, and the coefficients of x -> a x + b x³ + c x⁵ that each applies to singular values.
const ITERATIONS: usize = 5;
const COEFFICIENTS: [f32; 3] = [3.4445, -4.775, 2.0315];
/// Size of Adam's steps (RMS) in learning rates, about.
const ADAM_STEP: f32 = 0.2;

/// The moving averages of an optimiser.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Moments {
    steps: u64,
    /// Moving average of the gradient.
    mean: Vec<f32>,
    /// Moving average of its square; Muon has none and leaves it as it is.
    square: Vec<f32>,
}

impl Moments {
    /// Those of `count` weights before the first step.
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

    /// Bias corrections 1 - beta^steps of Adam's two averages, which start from zero.
    pub fn corrections(steps: u64) -> [f32; 2] {
        [BETA_1, BETA_2].map(|beta| (1.0 - beta.powf(steps as f64)) as f32)
    }

    /// Updates the weights with the learning rate `rate`: those of `muon` with Muon, all others with
    /// Adam.
    pub fn step(
        &mut self,
        weights: &mut [f32],
        gradients: &[f32],
        rate: f64,
        muon: &[HiddenMatrix],
    ) {
        self.steps += 1;
        let rate = rate as f32;
        let mut next = 0;
        for matrix in muon {
            self.adam(next..matrix.start, weights, gradients, rate);
            next = matrix.range().end;
        }
        self.adam(next..weights.len(), weights, gradients, rate);
        self.muon(muon, weights, gradients, rate);
    }

    fn adam(&mut self, range: Range<usize>, weights: &mut [f32], gradients: &[f32], rate: f32) {
        let [mean_part, square_part] = Self::corrections(self.steps);
        let (beta_1, beta_2) = (BETA_1 as f32, BETA_2 as f32);
        let averages = self.mean[range.clone()].iter_mut().zip(&mut self.square[range.clone()]);
        let weights = weights[range.clone()].iter_mut().zip(&gradients[range]);
        for ((weight, &g), (mean, square)) in weights.zip(averages) {
            *mean = beta_1 * *mean + (1.0 - beta_1) * g;
            *square = beta_2 * *square + (1.0 - beta_2) * g * g;
            *weight -= rate * (*mean / mean_part) / ((*square / square_part).sqrt() + EPSILON);
        }
    }

    fn muon(
        &mut self,
        matrices: &[HiddenMatrix],
        weights: &mut [f32],
        gradients: &[f32],
        rate: f32,
    ) {
        let average = |mean: f32, g: f32| MUON_BETA * mean + (1.0 - MUON_BETA) * g;
        for k in matrices.iter().flat_map(HiddenMatrix::range) {
            self.mean[k] = average(self.mean[k], gradients[k]);
        }
        // Nesterov's momentum: as if the next gradient were this one.
        let ahead = |k: usize| average(self.mean[k], gradients[k]);
        let direction = |matrix: &HiddenMatrix| {
            let rows = matrix.range().map(ahead);
            orthogonal(DMatrix::from_row_iterator(matrix.rows, matrix.columns, rows))
        };
        let directions: Vec<_> = matrices.par_iter().map(direction).collect();
        for (matrix, direction) in matrices.iter().zip(directions) {
            let factor = rate * ADAM_STEP * (matrix.rows.max(matrix.columns) as f32).sqrt();
            for (weight, step) in weights[matrix.range()].iter_mut().zip(&direction.transpose()) {
                *weight -= factor * step;
            }
        }
    }
}

/// The approximate orthogonal factor of a matrix.
fn orthogonal(matrix: DMatrix<f32>) -> DMatrix<f32> {
    let [a, b, c] = COEFFICIENTS;
    let norm = matrix.norm().max(f32::MIN_POSITIVE.sqrt());
    (0..ITERATIONS).fold(matrix / norm, |x, _| {
        let gram = x.tr_mul(&x);
        let polynomial = &gram * b + &gram * &gram * c;
        &x * a + x * polynomial
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_steps_are_as_long_as_the_rate_and_a_bowl_is_descended() {
        let mut weights = vec![1.0_f32, -2.0];
        let mut adam = Moments::new(2);
        let gradient = |w: &[f32]| vec![2.0 * w[0], 20.0 * w[1]];
        let first = gradient(&weights);
        adam.step(&mut weights, &first, 0.01, &[]);
        assert!((weights[0] - 0.99).abs() < 1e-6 && (weights[1] + 1.99).abs() < 1e-6);
        for _ in 0..2000 {
            let gradient = gradient(&weights);
            adam.step(&mut weights, &gradient, 0.01, &[]);
        }
        assert!(weights.iter().all(|w| w.abs() < 1e-3), "{weights:?}");
    }

    /// Directions whose gradients differ a thousandfold are learnt at the same pace, and weights
    /// beside the matrix are Adam's.
    #[test]
    fn muon_moves_all_directions_of_a_matrix_alike() {
        let (rows, columns) = (6, 3);
        let matrix = HiddenMatrix { start: 1, rows, columns };
        // Two orthogonal pairs of directions, u v^T.
        let [u, v] = [[1.0_f32, 1.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 3.0, -4.0, 0.0, 0.0]];
        let [w, x] = [[0.0_f32, 1.0, 0.0], [0.6, 0.0, -0.8]];
        let at = |k: usize| [u[k / 3] / 2_f32.sqrt() * w[k % 3], v[k / 3] / 5.0 * x[k % 3]];
        let mut gradients = vec![0.5_f32];
        gradients.extend((0..rows * columns).map(|k| 10.0 * at(k)[0] + 0.01 * at(k)[1]));
        gradients.push(-0.5);
        let mut weights = vec![0.0_f32; rows * columns + 2];
        Moments::new(weights.len()).step(&mut weights, &gradients, 1.0, &[matrix]);
        assert!((weights[0] + 1.0).abs() < 1e-4 && (weights[19] - 1.0).abs() < 1e-4);
        let factor = ADAM_STEP * 6_f32.sqrt();
        for direction in 0..2 {
            let moved: f32 = (0..18).map(|k| -weights[k + 1] * at(k)[direction]).sum();
            // What five iterations make of singular values from 1e-3 to 1 lies between 0.3 and 1.2.
            assert!((0.3..1.25).contains(&(moved / factor)), "{direction}: {}", moved / factor);
        }
    }
}
