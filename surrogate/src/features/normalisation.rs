//! Normalisation of inputs and targets.

use serde::{Deserialize, Serialize};

use super::surfaces::SURFACE_VELOCITY;
use crate::network::NodeFeature;

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

    /// The same normalisation for frames `ratio` times as far apart, with these node features: velocities per frame
    /// are `ratio` times as large, accelerations `ratio`² times. A network that has learnt the one is then a first
    /// approximation to the other: it sees the same velocities and accelerations, in a window `ratio` times as long.
    pub fn stretched(&self, node_features: &[NodeFeature], ratio: f64) -> Self {
        let times = |factor: f64, values: &[f64]| values.iter().map(|x| factor * x).collect();
        let mut stretched = Self {
            velocity_mean: times(ratio, &self.velocity_mean),
            velocity_std: times(ratio, &self.velocity_std),
            acceleration_mean: times(ratio * ratio, &self.acceleration_mean),
            acceleration_std: times(ratio * ratio, &self.acceleration_std),
            ..self.clone()
        };
        let mut first = 0;
        for feature in node_features {
            let columns = feature.columns(self.velocity_mean.len());
            let (scaled, factor): (Vec<usize>, f64) = match feature {
                NodeFeature::Acceleration => ((0..columns).collect(), ratio * ratio),
                NodeFeature::Surfaces => (SURFACE_VELOCITY.to_vec(), ratio),
                NodeFeature::Overburden
                | NodeFeature::InitialStress
                | NodeFeature::InitialSolidFraction
                | NodeFeature::Material => (Vec::new(), 1.0),
            };
            for column in scaled {
                stretched.features_mean[first + column] *= factor;
                stretched.features_std[first + column] *= factor;
            }
            first += columns;
        }
        stretched
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Per frame, twice the time makes velocities twice and accelerations four times as large.
    #[test]
    fn stretching_scales_what_is_per_frame() {
        let features = [NodeFeature::Overburden, NodeFeature::Acceleration, NodeFeature::Surfaces];
        let columns = features.iter().map(|feature| feature.columns(2)).sum();
        let norm = Normalisation {
            velocity_mean: vec![1.0, 2.0],
            features_mean: vec![1.0; columns],
            features_std: vec![1.0; columns],
            ..Normalisation::about_zero(2, 3.0, 5.0)
        };
        let twice = norm.stretched(&features, 2.0);
        assert_eq!(twice.velocity_mean, [2.0, 4.0]);
        assert_eq!(twice.velocity_std, [6.0, 6.0]);
        assert_eq!(twice.acceleration_std, [20.0, 20.0]);
        let (fixed, moving) = ([1.0; 4], [1.0, 1.0, 1.0, 2.0, 2.0, 1.0]);
        assert_eq!(twice.features_std, [&[1.0, 4.0, 4.0][..], &fixed, &moving].concat());
        assert_eq!(twice.features_mean, twice.features_std);
        assert_eq!(norm.stretched(&features, 1.0), norm);
    }
}
