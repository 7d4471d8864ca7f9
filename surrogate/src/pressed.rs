//! Points pressed together, as no material can be.
//!
//! A network that has learnt too little to hold material up lets points fall into each other. What it
//! predicts from there on means nothing, but each frame takes longer than the last: points come to
//! have hundreds of neighbours.

use std::f64::consts::PI;

use crate::graph::radius_graph;
use crate::rollout::RolloutError;

/// Most neighbours that points may have on average, in units of those of points that fill the plane.
/// Direct runs have less than one: 118, most of which the model that ships has learnt from, 0.49 to 0.94.
const MOST: f64 = 3.0;

/// How many neighbours points can have.
#[derive(Clone, Copy, Debug)]
pub struct Packing {
    radius: f32,
    /// Neighbours of a point among points that fill the plane.
    plane: f64,
}

impl Packing {
    /// For neighbours within `radius` (m) among points that are `spacing` (m) apart.
    pub fn new(radius: f64, spacing: f64) -> Self {
        Self { radius: radius as f32, plane: PI * (radius / spacing).powi(2) }
    }

    /// Most directed edges of a frame of so many points.
    pub fn most_edges(&self, points: usize) -> usize {
        (MOST * self.plane * points as f64) as usize
    }

    /// Counts the neighbours in a predicted frame.
    ///
    /// # Errors
    /// If the points have too many.
    pub fn check(&self, frame: usize, positions: &[[f64; 2]]) -> Result<(), RolloutError> {
        let single: Vec<f32> = positions.as_flattened().iter().map(|&x| x as f32).collect();
        let edges = radius_graph(&single, 2, self.radius).edges();
        if edges <= self.most_edges(positions.len()) {
            return Ok(());
        }
        let neighbours = edges as f64 / positions.len() as f64;
        Err(RolloutError::Pressed { frame, neighbours, plane: self.plane })
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
        let packing = Packing::new(0.25, 0.1);
        assert_eq!(packing.most_edges(1600), (3.0 * PI * 6.25 * 1600.0) as usize);
        assert_eq!(packing.check(7, &square(0.1)), Ok(()));
        assert_eq!(packing.check(7, &square(0.1 / 2.5_f64.sqrt())), Ok(()));
        let error = packing.check(7, &square(0.1 / 4.5_f64.sqrt())).unwrap_err();
        let RolloutError::Pressed { frame: 7, neighbours, plane } = error else {
            panic!("{error}")
        };
        assert!(neighbours > 3.0 * plane && neighbours < 4.5 * plane, "{neighbours} {plane}");
    }
}
