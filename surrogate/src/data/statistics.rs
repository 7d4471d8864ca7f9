//! Mean and standard deviation of velocities and accelerations, for the normalisation.

pub use dempm::dataset::Welford;

use super::{DataError, DataSet};
use crate::features::{Normalisation, SURFACE_VELOCITY, moving_features};
use crate::network::{ModelConfig, NodeFeature, feature_columns};

/// Smallest standard deviation (m/frame), below any motion of grains: keeps directions without
/// motion finite.
const NO_MOTION: f64 = 1e-9;

/// Statistics of velocities and accelerations of a data set, along x and y.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// First differences, m/frame.
    pub velocity: [Welford; 2],
    /// Second differences, m/frame².
    pub acceleration: [Welford; 2],
}

impl Statistics {
    /// Measures all frames of all files; with `without_gravity`, accelerations relative to free fall.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn measure(data: &DataSet, without_gravity: bool) -> Result<Self, DataError> {
        let mut statistics = Self::default();
        let stride = data.shape().stride;
        let interval = data.frame_interval();
        for recording in data.recordings() {
            let fall = recording.header().gravity.map(|g| g * interval * interval);
            for first in 0..stride.min(recording.frames()) {
                let mut before: Option<Vec<f64>> = None;
                let mut velocity: Option<Vec<f64>> = None;
                for frame in (first..recording.frames()).step_by(stride) {
                    let now = recording.positions(frame)?;
                    let present: Option<Vec<f64>> =
                        before.map(|before| now.iter().zip(before).map(|(x, b)| x - b).collect());
                    for (place, &v) in present.iter().flatten().enumerate() {
                        statistics.velocity[place % 2].add(v);
                        if let Some(past) = &velocity {
                            let gravity = if without_gravity { fall[place % 2] } else { 0.0 };
                            statistics.acceleration[place % 2].add(v - past[place] - gravity);
                        }
                    }
                    velocity = present;
                    before = Some(now);
                }
            }
        }
        Ok(statistics)
    }

    /// The same with the mirror images of all trajectories.
    pub fn mirrored(mut self) -> Self {
        self.velocity[0] = self.velocity[0].symmetric();
        self.acceleration[0] = self.acceleration[0].symmetric();
        self
    }

    /// Normalisation of training data with `noise` (m/frame) on the velocities.
    pub fn normalisation(&self, noise: f64) -> Normalisation {
        let mean = |of: [Welford; 2]| of.map(|w| w.mean()).to_vec();
        let deviation = |of: [Welford; 2]| of.map(|w| w.deviation().hypot(noise).max(NO_MOTION));
        Normalisation {
            velocity_mean: mean(self.velocity),
            velocity_std: deviation(self.velocity).to_vec(),
            acceleration_mean: mean(self.acceleration),
            acceleration_std: deviation(self.acceleration).to_vec(),
            ..Normalisation::default()
        }
    }
}

/// Smallest standard deviation of what is known of the material: data of one material must not make
/// another one look a thousand deviations away.
const LEAST_OF_MATERIAL: f64 = 0.1;

/// Means and standard deviations of the optional node features of a network, over the points of
/// all files and, unless static, every tenth frame. The mean of accelerations is taken as zero. Those of
/// surfaces, of which most points have none in reach, are 0 and 1; velocities of surfaces have the
/// deviation of the points' in `normalisation`.
///
/// # Errors
/// If a file cannot be read.
pub fn further_features(
    data: &DataSet,
    config: &ModelConfig,
    normalisation: &Normalisation,
) -> Result<[Vec<f64>; 2], DataError> {
    let [all, width] = feature_columns(&config.node_features, config.dimensions);
    let stride = data.shape().stride;
    let mut spread = vec![Welford::default(); all];
    for (recording, statics) in data.recordings().iter().zip(data.statics()) {
        let (mut column, mut mine) = (0, 0);
        for feature in &config.node_features {
            let count = feature.columns(config.dimensions);
            if feature.is_static() {
                for k in 0..count {
                    let values = statics.iter().skip(mine + k).step_by(width);
                    values.for_each(|&value| spread[column + k].add(f64::from(value)));
                }
                mine += count;
            } else if *feature != NodeFeature::Surfaces {
                let before = feature.frames_before();
                for frame in (before * stride..recording.frames()).step_by(10) {
                    let frames = (0..=before).rev().map(|k| {
                        let positions = recording.positions(frame - k * stride)?;
                        Ok(positions.iter().map(|&x| x as f32).collect())
                    });
                    let frames = frames.collect::<Result<Vec<Vec<f32>>, DataError>>()?;
                    let frames: Vec<&[f32]> = frames.iter().map(Vec::as_slice).collect();
                    let radius = config.connection_radius as f32;
                    let values = moving_features(&[*feature], &frames, &[], 0, radius);
                    for (place, &value) in values.iter().flatten().enumerate() {
                        spread[column + place % count].add(f64::from(value));
                    }
                }
                if *feature == NodeFeature::Acceleration {
                    let all = &mut spread[column..column + count];
                    all.iter_mut().for_each(|spread| *spread = spread.symmetric());
                }
            }
            column += count;
        }
    }
    // Keeps the rounding of constant features small.
    let deviation = |w: &Welford| w.deviation().max(1e-6 * w.mean().abs()).max(NO_MOTION);
    let mean = spread.iter().map(Welford::mean).collect();
    let mut std: Vec<f64> = spread.iter().map(deviation).collect();
    let mut rest = std.as_mut_slice();
    for feature in &config.node_features {
        let (mine, others) = rest.split_at_mut(feature.columns(config.dimensions));
        match feature {
            NodeFeature::Material => {
                mine.iter_mut().for_each(|std| *std = std.max(LEAST_OF_MATERIAL));
            }
            NodeFeature::Surfaces => {
                mine.fill(1.0);
                for (column, std) in SURFACE_VELOCITY.into_iter().zip(&normalisation.velocity_std) {
                    mine[column] = *std;
                }
            }
            _ => {}
        }
        rest = others;
    }
    Ok([mean, std])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_spread_about_a_large_mean() {
        let mut welford = Welford::default();
        for k in 0..1000 {
            welford.add(1.0e6 + f64::from(k % 2));
        }
        assert!((welford.mean() - 1_000_000.5).abs() < 1e-9);
        assert!((welford.deviation() - 0.5).abs() < 1e-9, "{}", welford.deviation());
        let symmetric = welford.symmetric();
        assert_eq!(symmetric.mean(), 0.0);
        assert!((symmetric.deviation() / 1_000_000.5 - 1.0).abs() < 1e-9);
    }
}
