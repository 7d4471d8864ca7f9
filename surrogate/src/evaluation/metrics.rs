//! Error metrics of predicted trajectories, frame by frame.

use serde::{Deserialize, Serialize};

use super::profile::profile_difference;

/// Errors of one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameError {
    /// Time, s.
    pub time: f64,
    /// Root mean square distance of the points, m.
    pub distance: f64,
    /// The same, squared, in units of the squared width of the domain (box²): the paper's error.
    pub mse: f64,
    /// Front position (largest x) minus the true one, m.
    pub front: f64,
    /// Root mean square difference of the depths in columns of fixed width, m.
    pub height: f64,
    /// Distance between the centres of mass, m.
    pub centre: f64,
}

/// What positions of points are compared by.
#[derive(Clone, Debug)]
pub struct Measure {
    /// Masses of the points, kg/m.
    pub mass: Vec<f64>,
    /// Initial distance between points, m.
    pub spacing: f64,
    /// Width of the domain, m.
    pub width: f64,
}

impl Measure {
    /// Compares predicted positions (m) with the true ones at a time (s).
    pub fn between(&self, predicted: &[[f64; 2]], truth: &[[f64; 2]], time: f64) -> FrameError {
        let total: f64 = self.mass.iter().sum();
        // Means over the points, by mass.
        let mean = |of: &dyn Fn(&[f64; 2], &[f64; 2]) -> f64| {
            let pairs = predicted.iter().zip(truth).zip(&self.mass);
            pairs.map(|((p, t), mass)| mass * of(p, t)).sum::<f64>() / total.max(f64::MIN_POSITIVE)
        };
        let front = |of: &[[f64; 2]]| of.iter().map(|x| x[0]).fold(f64::MIN, f64::max);
        let centre = |k: usize| mean(&|p, t| p[k] - t[k]);
        let square = mean(&|p, t| (p[0] - t[0]).powi(2) + (p[1] - t[1]).powi(2));
        let Self { ref mass, spacing, width } = *self;
        FrameError {
            time,
            distance: square.sqrt(),
            mse: square / (width * width),
            front: front(predicted) - front(truth),
            height: profile_difference(predicted, truth, mass, spacing, width),
            centre: centre(0).hypot(centre(1)),
        }
    }
}

/// Mean of |a - b|² over the points, m²; 0 without points.
pub fn mean_square_distance(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    let square = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
    a.iter().zip(b).map(square).sum::<f64>() / b.len().max(1) as f64
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

    /// The errors where they are largest, with the number of the frame; `None` without frames.
    pub fn peak(&self) -> Option<(FrameError, usize)> {
        let frames = self.errors.iter().zip(&self.frames);
        let largest = frames.max_by(|(a, _), (b, _)| a.mse.total_cmp(&b.mse));
        largest.map(|(error, &frame)| (*error, frame))
    }

    /// Root mean square distance over points and frames, m; infinite if the rollout ended early.
    pub fn mean_distance(&self) -> f64 {
        if self.failure.is_some() || self.errors.is_empty() {
            return f64::INFINITY;
        }
        let squares = self.errors.iter().map(|e| e.distance * e.distance);
        (squares.sum::<f64>() / self.errors.len() as f64).sqrt()
    }

    /// Errors of the last frame.
    pub fn last(&self) -> Option<FrameError> {
        self.errors.last().copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All points of a row move by (0.03, -0.04) m: 0.05 m, in a box of 10 m.
    #[test]
    fn a_shift_is_as_long_as_its_vector() {
        let truth: Vec<[f64; 2]> = (0..8).map(|k| [0.25 + 0.5 * f64::from(k), 1.0]).collect();
        let predicted: Vec<[f64; 2]> = truth.iter().map(|[x, y]| [x + 0.03, y - 0.04]).collect();
        let measure = Measure { mass: vec![2.0; 8], spacing: 0.5, width: 10.0 };
        let error = measure.between(&predicted, &truth, 1.5);
        assert!((error.distance - 0.05).abs() < 1e-12);
        assert!((error.mse - 0.05_f64.powi(2) / 100.0).abs() < 1e-15);
        assert!((error.front - 0.03).abs() < 1e-12);
        assert!((error.centre - 0.05).abs() < 1e-12);
        let same = measure.between(&truth, &truth, 1.5);
        assert_eq!([same.distance, same.mse, same.front, same.height, same.centre], [0.0; 5]);
    }

    /// A point that stands for a quarter of the mass of another counts a quarter: sqrt(0.1² x 1/5).
    #[test]
    fn points_count_by_their_mass() {
        let measure = Measure { mass: vec![4.0, 1.0], spacing: 0.5, width: 10.0 };
        let error = measure.between(&[[0.0, 0.0], [1.1, 0.0]], &[[0.0, 0.0], [1.0, 0.0]], 0.0);
        assert!((error.distance - 0.1 * 0.2_f64.sqrt()).abs() < 1e-12);
        assert!((error.centre - 0.02).abs() < 1e-12);
    }
}
