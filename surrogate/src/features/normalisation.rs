//! Normalisation of inputs and targets.

use serde::{Deserialize, Serialize};

/// Means and standard deviations of a training set, per component of space.
///
/// Velocities are x_k - x_(k-1) (m/frame), accelerations x_(k+1) - 2 x_k + x_(k-1) (m/frame²).
/// Standard deviations are positive.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Normalisation {
    /// Mean velocity, m/frame.
    pub velocity_mean: Vec<f64>,
    /// Standard deviation of the velocity, m/frame.
    pub velocity_std: Vec<f64>,
    /// Mean acceleration, m/frame².
    pub acceleration_mean: Vec<f64>,
    /// Standard deviation of the acceleration, m/frame².
    pub acceleration_std: Vec<f64>,
    /// Means of the columns of the [node features](crate::network::NodeFeature).
    pub features_mean: Vec<f64>,
    /// Standard deviations of the same columns.
    pub features_std: Vec<f64>,
}

impl Normalisation {
    /// Zero means and equal deviations along all axes (m/frame, m/frame²).
    pub fn about_zero(dimensions: usize, velocity: f64, acceleration: f64) -> Self {
        Self {
            velocity_mean: vec![0.0; dimensions],
            velocity_std: vec![velocity; dimensions],
            acceleration_mean: vec![0.0; dimensions],
            acceleration_std: vec![acceleration; dimensions],
            ..Self::default()
        }
    }
}
