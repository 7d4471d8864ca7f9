//! The learning rate of each step.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

/// Shape of the decay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Decay {
    /// By a factor of ten every `decay_steps`, towards `final_rate`, as in the paper.
    #[default]
    Exponential,
    /// Half a cosine, to `final_rate` at the last step.
    Cosine,
}

/// Learning-rate schedule.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Schedule {
    /// Shape of the decay.
    pub kind: Decay,
    /// Initial rate.
    pub rate: f64,
    /// Final rate.
    pub final_rate: f64,
    /// Steps in which an exponential decay divides the rate by ten.
    pub decay_steps: f64,
    /// Steps of linear warm-up from zero.
    pub warm_up: u64,
}

impl Default for Schedule {
    fn default() -> Self {
        Self {
            kind: Decay::Exponential,
            rate: 1e-4,
            final_rate: 1e-6,
            decay_steps: 5e6,
            warm_up: 0,
        }
    }
}

impl Schedule {
    /// The rate of step number `step` (from 0) of `steps`. With `ranks` processes a step has as many
    /// times the windows, so the exponential decay is faster by that factor.
    pub fn at(&self, step: u64, steps: u64, ranks: usize) -> f64 {
        let part = match self.kind {
            Decay::Exponential => 0.1_f64.powf(step as f64 * ranks as f64 / self.decay_steps),
            Decay::Cosine => {
                let length = steps.saturating_sub(self.warm_up).max(1) as f64;
                let done = step.saturating_sub(self.warm_up) as f64 / length;
                0.5 * (1.0 + (PI * done.min(1.0)).cos())
            }
        };
        let grown = (step + 1) as f64 / (self.warm_up + 1) as f64;
        grown.min(1.0) * (self.final_rate + (self.rate - self.final_rate) * part)
    }

    /// Whether the rate depends on the number of steps.
    pub(super) fn depends_on_steps(&self) -> bool {
        self.kind == Decay::Cosine
    }
}

/// Decay of the moving average of the weights at a step, the first of which is 1. It is smaller
/// early on, so that the average forgets the random initial weights.
pub fn average_decay(decay: f64, step: u64) -> f32 {
    let step = step as f64;
    decay.min((1.0 + step) / (10.0 + step)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper() {
        let schedule = Schedule::default();
        assert_eq!(schedule.at(0, 1, 1), 1e-4);
        let expected = (1e-4 - 1e-6) * 0.1 + 1e-6;
        assert!((schedule.at(5_000_000, 1, 1) / expected - 1.0).abs() < 1e-12);
        assert!((schedule.at(1_250_000, 1, 4) / expected - 1.0).abs() < 1e-12);
    }

    #[test]
    fn warm_up_and_cosine() {
        let schedule = Schedule {
            kind: Decay::Cosine,
            rate: 1.0,
            final_rate: 0.1,
            warm_up: 9,
            decay_steps: 1.0,
        };
        assert!((schedule.at(0, 109, 1) - 0.1).abs() < 1e-12);
        assert!((schedule.at(9, 109, 1) - 1.0).abs() < 1e-12);
        assert!((schedule.at(59, 109, 1) - 0.55).abs() < 1e-12);
        assert!((schedule.at(109, 109, 1) - 0.1).abs() < 1e-12);
    }
}
