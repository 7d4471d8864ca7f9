//! Smoothing of trajectories in time.
//!
//! A point of a scene of discs is the mean of tens of grains, whose rattling shakes it. From frame to frame that
//! shaking makes up most of its accelerations, and no network can predict it.

/// Half the width of a window over the standard deviation of its weights.
const REACH: f64 = 3.0;

/// Local quadratic regression with Gaussian weights (Savitzky and Golay 1964; Cleveland 1979): each frame becomes
/// the value there of the parabola that fits the frames around it best. Free fall stays as it is.
///
/// Windows are symmetric and end at the first and the last frame. So the first frame stays as it is, and what is
/// released in it does not move before.
#[derive(Clone, Debug)]
pub(super) struct Smoothing {
    /// Weights of a window of 2 k + 1 frames, for k = 0 to that of the widest.
    weights: Vec<Vec<f64>>,
}

impl Smoothing {
    /// Smoothing with weights of this standard deviation (frames).
    pub fn new(deviation: f64) -> Self {
        let widest = (REACH * deviation).ceil() as usize;
        Self { weights: (0..=widest).map(|half| weights(half, deviation)).collect() }
    }

    /// The frame number `frame` of `frames`, smoothed; `read` gives the coordinates of a frame.
    ///
    /// # Errors
    /// If `read` fails.
    pub fn frame<X: AsRef<[f64]>, E>(
        &self,
        frame: usize,
        frames: usize,
        read: impl Fn(usize) -> Result<X, E>,
    ) -> Result<Vec<f64>, E> {
        let half = frame.min(frames - 1 - frame).min(self.weights.len() - 1);
        let mut sum = Vec::new();
        for (k, weight) in self.weights[half].iter().enumerate() {
            let x = read(frame + k - half)?;
            sum.resize(x.as_ref().len(), 0.0);
            sum.iter_mut().zip(x.as_ref()).for_each(|(sum, x)| *sum += weight * x);
        }
        Ok(sum)
    }
}

/// Weights of the frames k = -h to h for the value at k = 0 of the parabola through them with the least squares weighted
/// by g_k = exp(-k² / 2 σ²): w_k = g_k (S_4 - S_2 k²) / (S_0 S_4 - S_2²), where S_n = Σ g_k kⁿ.
fn weights(half: usize, deviation: f64) -> Vec<f64> {
    if half == 0 {
        return vec![1.0];
    }
    let places: Vec<f64> = (0..=2 * half).map(|k| k as f64 - half as f64).collect();
    let gauss = |k: f64| (-0.5 * (k / deviation).powi(2)).exp();
    let sum = |power| places.iter().map(|&k| gauss(k) * k.powi(power)).sum::<f64>();
    let [s0, s2, s4] = [0, 2, 4].map(sum);
    let weight = |&k: &f64| gauss(k) * (s4 - s2 * k * k) / (s0 * s4 - s2 * s2);
    places.iter().map(weight).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn smoothed(deviation: f64, frames: &[f64]) -> Vec<f64> {
        let smoothing = Smoothing::new(deviation);
        let read = |frame: usize| Ok::<_, ()>(vec![frames[frame]]);
        (0..frames.len()).map(|k| smoothing.frame(k, frames.len(), read).unwrap()[0]).collect()
    }

    /// Free fall, with initial velocity, to round-off.
    #[test]
    fn parabolas_stay_as_they_are() {
        let fall: Vec<f64> =
            (0..40).map(|k| f64::from(k).mul_add(0.3, 2.0 - f64::from(k * k) * 5e-4)).collect();
        for deviation in [0.5, 3.0, 10.0] {
            let smoothed = smoothed(deviation, &fall);
            let errors = smoothed.iter().zip(&fall).map(|(a, b)| (a - b).abs());
            assert!(errors.fold(0.0, f64::max) < 1e-13);
        }
    }

    /// The first frame stays, whatever follows, and so does the second, as a parabola passes through three frames.
    #[test]
    fn a_start_stays_where_it_is() {
        let frames: Vec<f64> = (0..30).map(|k| f64::from(k * k * k)).collect();
        let smoothed = smoothed(3.0, &frames);
        assert_eq!(smoothed[0], frames[0]);
        assert!((smoothed[1] - frames[1]).abs() < 1e-12);
    }

    /// Independent noise of variance 1 gets the variance Σ w_k², of Gaussian weights for a parabola with σ = 3 about
    /// 27 / (32 σ √π) = 0.159: the integral of (3/2 - x² / 2)² g(x)² with the normal density g.
    #[test]
    fn noise_becomes_small() {
        let smoothing = Smoothing::new(3.0);
        let variance: f64 = smoothing.weights[9].iter().map(|w| w * w).sum();
        let expected = 27.0 / (32.0 * 3.0 * std::f64::consts::PI.sqrt());
        // The weights end at 3 σ.
        assert!((variance - expected).abs() < 0.05 * expected, "{variance} {expected}");
    }
}
