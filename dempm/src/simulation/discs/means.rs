//! Points as means over their grains.

use dem::assembly::PointMean;
use mpm::Points;
use serde::{Deserialize, Serialize};

/// Means of points that are no properties of [`Points`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointMeans {
    /// Area of the grains over the area that they occupy.
    pub solid_fraction: Vec<f64>,
    /// Contacts per grain.
    pub coordination: Vec<f64>,
}

impl PointMeans {
    /// Brings points up to date with the means over their grains: position, velocity, mass, stress, volume and
    /// velocity gradient.
    pub(super) fn update(means: &[PointMean], points: &mut Points) -> Self {
        for (p, mean) in means.iter().enumerate() {
            points.position[p] = mean.position;
            points.velocity[p] = mean.velocity;
            points.mass[p] = mean.mass;
            points.volume[p] = mean.volume;
            points.velocity_gradient[p] = mean.velocity_gradient;
            points.stress[p] = mean.stress;
        }
        Self {
            solid_fraction: means.iter().map(|mean| mean.solid_fraction).collect(),
            coordination: means.iter().map(|mean| mean.coordination).collect(),
        }
    }
}
