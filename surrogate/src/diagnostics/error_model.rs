//! A network's own error: what to expect of a rollout, from what is known of it without the truth.
//!
//! The error is the root mean square distance of the points from a run of the truth. A ridge regression of its
//! logarithm on a few features of scene and rollout gives its size; quantiles of true over fitted errors, each
//! measured on a scene that the regression has not seen, give median and bound (conformal prediction, Vovk, Gammerman
//! and Shafer 2005; cross-conformal, Vovk 2015).

use dempm::choose::quantile;
use serde::{Deserialize, Serialize};

use super::regression::Regression;

/// Number of features.
pub const FEATURES: usize = 9;
/// Features of a rollout at a time; `ErrorFeatures` measures them.
pub type Features = [f64; FEATURES];
/// Times at which errors are known, as parts of a rollout.
pub const PARTS: usize = 10;
/// Part of the scenes whose errors are to be below the bound.
pub const COVERED: f64 = 0.9;
/// Weight of the ridge, in scenes: features that say nothing get no weight.
const RIDGE: f64 = 1.0;
/// Errors below this (m) are alike.
const LEAST: f64 = 1.0e-4;
/// Least number of scenes: of fewer, none is the largest of nine tenths.
pub const LEAST_SCENES: usize = 9;

/// Features and errors of one rollout at the tenths of its length.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorSample {
    /// Name of the scene.
    pub scene: String,
    /// Features at each part, fewer than [`PARTS`] if the rollout failed.
    pub features: Vec<Features>,
    /// Errors there, m.
    pub errors: Vec<f64>,
}

impl ErrorSample {
    /// The true error at a part, infinite after a failure (m).
    fn error(&self, part: usize) -> f64 {
        self.errors.get(part).copied().unwrap_or(f64::INFINITY)
    }
}

/// An error to expect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpectedError {
    /// As often below as above, m.
    pub median: f64,
    /// Above it in one of ten scenes, m.
    pub bound: f64,
}

/// Predicts the error of a network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErrorModel {
    /// Scenes that it was calibrated on.
    pub scenes: usize,
    /// The model of their runs, as in scenes; older files do not state it.
    #[serde(default)]
    pub truth: Option<String>,
    /// Of the logarithm of the error.
    regression: Regression,
    /// Quantiles of true over fitted errors at each part.
    medians: Vec<f64>,
    bounds: Vec<f64>,
}

impl ErrorModel {
    /// Calibrates a model on rollouts of scenes that the network has not learnt from, one of each scene, against runs
    /// of the model `truth`. `None` of fewer than [`LEAST_SCENES`], or if more than a tenth failed.
    pub fn fit(samples: &[ErrorSample], truth: &str) -> Option<Self> {
        let count = samples.len();
        if count < LEAST_SCENES {
            return None;
        }
        let all: Vec<&ErrorSample> = samples.iter().collect();
        let regression = fit_logarithms(&all)?;
        let mut ratios: Vec<Vec<f64>> = vec![Vec::new(); PARTS];
        for left_out in 0..count {
            let others: Vec<&ErrorSample> = samples
                .iter()
                .enumerate()
                .filter(|(k, _)| *k != left_out)
                .map(|(_, sample)| sample)
                .collect();
            let others = fit_logarithms(&others)?;
            let sample = &samples[left_out];
            for (part, ratios) in ratios.iter_mut().enumerate() {
                let fitted = sample.features.get(part).map(|features| others.at(features).exp());
                ratios.push(fitted.map_or(f64::INFINITY, |fitted| sample.error(part) / fitted));
            }
        }
        let quantiles = |of: f64| -> Option<Vec<f64>> {
            ratios.iter().map(|ratios| quantile(ratios, of)).collect()
        };
        let (medians, bounds) = (quantiles(0.5)?, quantiles(COVERED)?);
        let known = bounds.iter().all(|bound| bound.is_finite());
        let truth = Some(truth.to_owned());
        known.then_some(Self { scenes: count, truth, regression, medians, bounds })
    }

    /// The error to expect at a part of a rollout, from 0 (its start) to 1 (its end).
    pub fn expected(&self, part: f64, features: &Features) -> ExpectedError {
        let size = self.regression.at(features).exp();
        let place = (part * PARTS as f64 - 1.0).clamp(0.0, (PARTS - 1) as f64);
        let (low, high) = (place.floor() as usize, place.ceil() as usize);
        let share = place - low as f64;
        let at = |of: &[f64]| (1.0 - share) * of[low] + share * of[high];
        ExpectedError { median: size * at(&self.medians), bound: size * at(&self.bounds) }
    }

    /// The part of scenes whose error at the end is below the bound, and of all scenes and parts.
    pub fn coverage(&self, samples: &[ErrorSample]) -> [f64; 2] {
        let is_below = |sample: &ErrorSample, part: usize| {
            let bound = |features| self.expected((part + 1) as f64 / PARTS as f64, features).bound;
            sample.features.get(part).is_some_and(|f| sample.error(part) <= bound(f))
        };
        let share = |parts: std::ops::Range<usize>| {
            let below =
                |sample: &ErrorSample| parts.clone().filter(|&k| is_below(sample, k)).count();
            let all = samples.len() * parts.len();
            samples.iter().map(below).sum::<usize>() as f64 / all.max(1) as f64
        };
        [share(PARTS - 1..PARTS), share(0..PARTS)]
    }
}

/// Ridge regression of the logarithms of errors.
fn fit_logarithms(samples: &[&ErrorSample]) -> Option<Regression> {
    let known = || samples.iter().flat_map(|sample| sample.features.iter().zip(&sample.errors));
    let rows: Vec<&[f64]> = known().map(|(features, _)| features.as_slice()).collect();
    let logarithms: Vec<f64> = known().map(|(_, error)| error.max(LEAST).ln()).collect();
    // The parts of a rollout are about one independent observation.
    Regression::fit(&rows, &logarithms, RIDGE * PARTS as f64)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Errors of `0.01 exp(f_0 + noise)`, with noise of a scene between -`noise` and `noise`.
    fn samples(count: usize, noise: f64, seed: u64) -> Vec<ErrorSample> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut uniform = move || 2.0 * random.random::<f64>() - 1.0;
        let mut one = |scene: usize| {
            let own = noise * uniform();
            let features: Vec<Features> =
                (0..PARTS).map(|_| std::array::from_fn(|_| uniform())).collect();
            let errors = features.iter().map(|f| 0.01 * (f[0] + own).exp()).collect();
            ErrorSample { scene: scene.to_string(), features, errors }
        };
        (0..count).map(&mut one).collect()
    }

    /// Without noise, what remains is the pull of the ridge: a scene in 200 that see all features at full size.
    #[test]
    fn the_regression_finds_what_errors_depend_on() {
        let model = ErrorModel::fit(&samples(200, 0.0, 1), "discs").unwrap();
        let at = |x: f64| {
            let mut features = [0.0; FEATURES];
            features[0] = x;
            model.expected(1.0, &features).median / (0.01 * x.exp())
        };
        for x in [-0.8, 0.0, 0.8] {
            assert!((at(x) - 1.0).abs() < 0.01, "{x}: {}", at(x));
        }
    }

    /// 90 % of new scenes are below the bound: of 1000, 900 within four standard errors of calibration (100 scenes,
    /// 0.03) and test (0.0095).
    #[test]
    fn nine_of_ten_new_scenes_are_below_the_bound() {
        let model = ErrorModel::fit(&samples(100, 1.0, 2), "discs").unwrap();
        let [end, all] = model.coverage(&samples(1000, 1.0, 3));
        assert!((end - 0.9).abs() < 4.0 * 0.0315, "{end}");
        assert!((all - 0.9).abs() < 4.0 * 0.0315, "{all}");
    }

    #[test]
    fn too_few_scenes_have_no_bound() {
        assert_eq!(ErrorModel::fit(&samples(LEAST_SCENES - 1, 1.0, 4), "discs"), None);
        assert!(ErrorModel::fit(&samples(LEAST_SCENES, 1.0, 4), "discs").is_some());
        // A failure is an infinite error, and may be the tenth of ten.
        let mut ten = samples(30, 1.0, 5);
        ten[0].features.truncate(3);
        ten[0].errors.truncate(3);
        let model = ErrorModel::fit(&ten, "discs").unwrap();
        assert!(model.coverage(&ten[..1])[0] < 0.5);
        for sample in &mut ten[..6] {
            sample.features.clear();
            sample.errors.clear();
        }
        assert_eq!(ErrorModel::fit(&ten, "discs"), None);
    }
}
