//! Noise on the positions in training, so that the network learns to correct its own errors in a
//! rollout.

use std::f64::consts::TAU;

use rand::{Rng, RngExt};

use super::Example;

impl Example {
    /// Adds a random walk to the positions: every frame adds a normal deviate to the error of the
    /// velocity, so that the error of the last velocity has the standard deviation `sigma`
    /// (m/frame).
    ///
    /// The target moves along with the last position (as in the GNS): the velocity after the step
    /// is the true one, so the acceleration to learn undoes the error of the velocity, but not that
    /// of the position, which no network could know.
    pub(super) fn add_noise(&mut self, sigma: f64, rng: &mut impl Rng) {
        let values = self.values();
        let velocities = self.positions.len() / values - 1;
        let step = sigma / (velocities as f64).sqrt();
        let mut velocity = vec![0.0; values];
        let mut position = vec![0.0; values];
        // The first frame has no velocity before it and stays as it is.
        for frame in self.positions.chunks_exact_mut(values).skip(1) {
            for ((x, error), drift) in frame.iter_mut().zip(&mut position).zip(&mut velocity) {
                *drift += step * normal(rng);
                *error += *drift;
                *x += *error;
            }
        }
        for (x, error) in self.next.iter_mut().zip(position) {
            *x += error;
        }
    }
}

/// A standard normal deviate (Box-Muller).
fn normal(rng: &mut impl Rng) -> f64 {
    let (radius, angle): (f64, f64) = (rng.random(), rng.random());
    // 1 - [0, 1) has a logarithm.
    (-2.0 * (1.0 - radius).ln()).sqrt() * (TAU * angle).cos()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::data::Welford;

    #[test]
    fn the_last_velocity_carries_the_whole_noise_and_the_target_undoes_it() {
        let (points, frames, sigma) = (20_000, 6, 3e-4);
        let still = Example {
            points,
            positions: vec![1.0; frames * 2 * points],
            next: vec![1.0; 2 * points],
            gravity: [0.0; 2],
            statics: Vec::new(),
            obstacles: Vec::new(),
        };
        let mut noisy = still.clone();
        noisy.add_noise(sigma, &mut ChaCha8Rng::seed_from_u64(1));
        assert_eq!(noisy.positions[..2 * points], still.positions[..2 * points]);
        let mut spread = Welford::default();
        for (velocity, acceleration) in noisy.velocity().into_iter().zip(noisy.acceleration()) {
            spread.add(velocity);
            assert!((velocity + acceleration).abs() < 1e-15, "the next velocity is the true one");
        }
        assert!((spread.deviation() / sigma - 1.0).abs() < 0.02, "{}", spread.deviation());
        assert!(spread.mean().abs() < 0.02 * sigma);
    }
}
