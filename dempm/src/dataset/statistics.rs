//! Mean and standard deviation of velocities and accelerations, as learned simulators see them:
//! differences of positions per frame, without a division by the time between frames.

use super::error::DatasetError;
use crate::trajectory::Trajectory;

/// Running mean and variance (Welford's algorithm), without differences of large sums.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Welford {
    count: u64,
    mean: f64,
    squares: f64,
}

impl Welford {
    /// Takes a value into account.
    pub fn add(&mut self, value: f64) {
        self.count += 1;
        let before = value - self.mean;
        self.mean += before / self.count as f64;
        self.squares += before * (value - self.mean);
    }

    /// The number of values.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The mean; zero without values.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Standard deviation of the population; zero without values.
    pub fn deviation(&self) -> f64 {
        (self.squares / self.count.max(1) as f64).sqrt()
    }

    /// The statistics if every value were accompanied by its negative.
    pub fn symmetric(self) -> Self {
        let count = self.count as f64;
        Self { mean: 0.0, squares: self.squares + count * self.mean * self.mean, ..self }
    }
}

/// Statistics per component: m/frame and m/frame².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// First differences of positions (m/frame).
    pub velocity: [Welford; 2],
    /// Second differences of positions (m/frame²).
    pub acceleration: [Welford; 2],
}

impl Statistics {
    /// Adds all points and frames of a trajectory.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn add(&mut self, trajectory: &Trajectory) -> Result<(), DatasetError> {
        // Positions two frames and one frame before.
        let (mut before, mut last): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        for index in 0..trajectory.frames() {
            let now = trajectory.positions(index..index + 1)?.into_raw_vec_and_offset().0;
            for (place, (x, x1)) in now.iter().zip(&last).enumerate() {
                let velocity = x - x1;
                self.velocity[place % 2].add(velocity);
                if let Some(x2) = before.get(place) {
                    self.acceleration[place % 2].add(velocity - (x1 - x2));
                }
            }
            before = std::mem::replace(&mut last, now);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_large_mean_does_not_swallow_the_deviation() {
        let mut w = Welford::default();
        (0..1000).for_each(|k| w.add(1.0e9 + f64::from(k % 2)));
        assert_eq!(w.mean(), 1.0e9 + 0.5);
        assert!((w.deviation() - 0.5).abs() < 1e-9);
        assert_eq!(Welford::default().deviation(), 0.0);
    }
}
