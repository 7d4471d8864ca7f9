//! Error metrics of predicted trajectories, frame by frame.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

/// Errors of one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameError {
    /// Time, s.
    pub time: f64,
    /// Mean over the points of |r - r*|², in units of the squared width of the domain (box²).
    pub mse: f64,
    /// Front position (largest x) minus the true one, m.
    pub front: f64,
    /// Root mean square difference of the height profiles, m.
    pub height: f64,
    /// Distance between the centres of mass, m.
    pub centre: f64,
}

impl FrameError {
    /// Compares predicted positions (m) with the true ones. `width` is that of the domain,
    /// `spacing` that of the strips of a height profile (m).
    pub fn between(
        predicted: &[[f64; 2]],
        truth: &[[f64; 2]],
        time: f64,
        width: f64,
        spacing: f64,
    ) -> Self {
        let count = truth.len().max(1) as f64;
        let front = |of: &[[f64; 2]]| of.iter().map(|x| x[0]).fold(f64::MIN, f64::max);
        let centre =
            |k: usize| predicted.iter().zip(truth).map(|(p, t)| p[k] - t[k]).sum::<f64>() / count;
        Self {
            time,
            mse: mean_square_distance(predicted, truth) / (width * width),
            front: front(predicted) - front(truth),
            height: profile_difference(predicted, truth, width, spacing),
            centre: centre(0).hypot(centre(1)),
        }
    }
}

/// Mean of |a - b|² over the points, m²; 0 without points.
pub fn mean_square_distance(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    let square = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
    a.iter().zip(b).map(square).sum::<f64>() / b.len().max(1) as f64
}

/// Root mean square difference of the largest y in vertical strips of the domain, over the strips
/// in which either has a point; an empty strip has height 0.
fn profile_difference(a: &[[f64; 2]], b: &[[f64; 2]], width: f64, spacing: f64) -> f64 {
    let last = (width / spacing).ceil().max(1.0) as usize - 1;
    // Occupied strips only: a domain may have far more strips than points.
    let profile = |points: &[[f64; 2]]| {
        let mut tops = BTreeMap::new();
        for &[x, y] in points {
            // Casting saturates, so points left of the domain are in the first strip.
            let strip = ((x / spacing) as usize).min(last);
            tops.entry(strip).and_modify(|top: &mut f64| *top = top.max(y)).or_insert(y);
        }
        tops
    };
    let (a, b) = (profile(a), profile(b));
    let strips: BTreeSet<&usize> = a.keys().chain(b.keys()).collect();
    let height = |of: &BTreeMap<usize, f64>, strip| of.get(strip).copied().unwrap_or(0.0);
    let squares = strips.iter().map(|strip| (height(&a, strip) - height(&b, strip)).powi(2));
    (squares.sum::<f64>() / strips.len().max(1) as f64).sqrt()
}

/// Errors of a rollout, frame by frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Name of the trajectory.
    pub case: String,
    /// Numbers of the compared frames, counted from the first of the trajectory.
    pub frames: Vec<usize>,
    /// Their errors.
    pub errors: Vec<FrameError>,
    /// The error that ended the rollout early.
    pub failure: Option<String>,
}

impl Errors {
    /// Mean of the MSE over all frames; infinite if the rollout ended early.
    pub fn mean(&self) -> f64 {
        if self.failure.is_some() || self.errors.is_empty() {
            return f64::INFINITY;
        }
        self.errors.iter().map(|e| e.mse).sum::<f64>() / self.errors.len() as f64
    }

    /// Largest MSE and its frame; `None` without frames.
    pub fn peak(&self) -> Option<(f64, usize)> {
        let frames = self.errors.iter().zip(&self.frames);
        let largest = frames.max_by(|(a, _), (b, _)| a.mse.total_cmp(&b.mse));
        largest.map(|(error, &frame)| (error.mse, frame))
    }

    /// Errors of the last frame.
    pub fn last(&self) -> Option<FrameError> {
        self.errors.last().copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_metric_measures_a_shift() {
        let truth: Vec<[f64; 2]> = (0..8).map(|k| [0.25 + 0.5 * f64::from(k), 1.0]).collect();
        let predicted: Vec<[f64; 2]> = truth.iter().map(|[x, y]| [x + 0.03, y - 0.04]).collect();
        let error = FrameError::between(&predicted, &truth, 1.5, 10.0, 0.5);
        assert!((error.mse - 0.05_f64.powi(2) / 100.0).abs() < 1e-15);
        assert!((error.front - 0.03).abs() < 1e-12);
        assert!((error.height - 0.04).abs() < 1e-12);
        assert!((error.centre - 0.05).abs() < 1e-12);
        let same = FrameError::between(&truth, &truth, 1.5, 10.0, 0.5);
        assert_eq!([same.mse, same.front, same.height, same.centre], [0.0; 4]);
    }

    #[test]
    fn a_strip_that_one_leaves_empty_counts() {
        let difference = profile_difference(&[[0.5, 2.0]], &[[1.5, 2.0]], 2.0, 1.0);
        assert_eq!(difference, 2.0);
    }

    #[test]
    fn a_wide_domain_takes_no_more_memory() {
        let points = [[0.5, 2.0], [9e17, 1.0]];
        assert_eq!(profile_difference(&points, &points, 1e18, 1.0), 0.0);
        assert_eq!(profile_difference(&points, &points[..1], 1e18, 1.0), 0.5_f64.sqrt());
    }
}
