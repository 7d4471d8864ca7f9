//! Points crowded as no material can be.
//!
//! A network that has not learnt to carry load lets points fall into each other. Its predictions
//! mean nothing from there on, and each frame takes longer than the last, as points come to have
//! hundreds of neighbours.

use std::f64::consts::PI;

use crate::features::radius_graph;
use crate::rollout::RolloutError;

/// Largest mean number of neighbours, in units of that of points that fill the plane. It stays
/// between 0.49 and 0.94 in 118 direct simulations.
const MOST: f64 = 3.0;

/// Limit on the mean number of neighbours of a point.
#[derive(Clone, Copy, Debug)]
pub struct CrowdingLimit {
    /// Connection radius, m.
    radius: f32,
    /// Neighbours of a point among points that fill the plane.
    plane: f64,
}

impl CrowdingLimit {
    /// For neighbours within `radius` (m) of points that are `spacing` (m) apart at first.
    pub fn new(radius: f64, spacing: f64) -> Self {
        Self { radius: radius as f32, plane: PI * (radius / spacing).powi(2) }
    }

    /// Largest number of directed edges of a frame of `points` points.
    pub fn most_edges(&self, points: usize) -> usize {
        (MOST * self.plane * points as f64) as usize
    }

    /// Counts the neighbours in predicted frame number `frame`; `positions` are in m.
    ///
    /// # Errors
    /// [`RolloutError::Crowded`] above the limit.
    pub fn check(&self, frame: usize, positions: &[[f64; 2]]) -> Result<(), RolloutError> {
        let single: Vec<f32> = positions.as_flattened().iter().map(|&x| x as f32).collect();
        let edges = radius_graph(&single, self.radius).edges();
        if edges <= self.most_edges(positions.len()) {
            return Ok(());
        }
        let neighbours = edges as f64 / positions.len() as f64;
        Err(RolloutError::Crowded { frame, neighbours, plane: self.plane })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of 40 x 40 points, which has fewer neighbours at its edges than the plane has.
    fn square(spacing: f64) -> Vec<[f64; 2]> {
        (0..1600).map(|k| [(k % 40) as f64 * spacing, (k / 40) as f64 * spacing]).collect()
    }

    #[test]
    fn three_times_as_dense_is_too_dense() {
        let limit = CrowdingLimit::new(0.25, 0.1);
        assert_eq!(limit.most_edges(1600), (3.0 * PI * 6.25 * 1600.0) as usize);
        assert_eq!(limit.check(7, &square(0.1)), Ok(()));
        assert_eq!(limit.check(7, &square(0.1 / 2.5_f64.sqrt())), Ok(()));
        let error = limit.check(7, &square(0.1 / 4.5_f64.sqrt())).unwrap_err();
        let RolloutError::Crowded { frame: 7, neighbours, plane } = error else {
            panic!("{error}")
        };
        assert!(neighbours > 3.0 * plane && neighbours < 4.5 * plane, "{neighbours} {plane}");
    }
}
