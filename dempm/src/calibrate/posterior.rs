//! What the tests tell about the parameters: samples of the posterior.

use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::emulator::Emulator;
use super::ensemble::standard_normal;
use super::likelihood::Likelihood;
use super::sampler::sample;
use super::targets::Targets;

/// How well the tests determine a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Determined {
    /// They narrow its prior to less than a third.
    Well,
    /// They narrow it to less than two thirds.
    Weakly,
    /// They hardly narrow it.
    Not,
}

/// Samples of the parameters given the measurements, and their moments.
#[derive(Clone, Debug)]
pub struct Posterior {
    likelihood: Likelihood,
    /// Logarithm of the likelihood of each sample.
    fit: Vec<f64>,
    /// Samples of the values of the parameters.
    pub samples: Vec<Vec<f64>>,
    /// Mean of each parameter.
    pub mean: Vec<f64>,
    /// Standard deviation.
    pub sd: Vec<f64>,
    /// 2.5 % and 97.5 % quantiles.
    pub interval: Vec<[f64; 2]>,
    /// Correlations of the standard normal variables.
    pub correlation: DMatrix<f64>,
    /// How well each is determined.
    pub determined: Vec<Determined>,
    /// Mean, 2.5 % and 97.5 % quantile of each predicted value, without scatter of the packings.
    pub predicted: Vec<[f64; 3]>,
}

/// Samples are drawn by so many walkers in so many sweeps; the first of these are left out, and of the others most.
const WALKERS: usize = 100;
const SWEEPS: usize = 800;
const BURN_IN: usize = 200;
const KEEP: usize = 20;
/// Distance of walkers from the members of the ensemble where they start.
const APART: f64 = 0.1;
/// Posterior over prior standard deviation below which a parameter is well, and weakly, determined.
const WELL: f64 = 1.0 / 3.0;
const WEAKLY: f64 = 2.0 / 3.0;
/// Correlation from which two parameters are determined together only.
const TOGETHER: f64 = 0.8;

impl Posterior {
    /// Samples from near the variables `u` of an ensemble. `None` if simulations and measurements make no covariance.
    pub(super) fn sample(targets: &Targets, emulator: Emulator, u: &[Vec<f64>]) -> Option<Self> {
        let [y, sd] = [targets.observed(), targets.deviations()];
        let likelihood = Likelihood::new(emulator, &y, &sd, targets.free.len())?;
        let log_density = |u: &DVector<f64>| {
            -0.5 * u.norm_squared() + likelihood.log(&targets.coordinates(u.as_slice()))
        };
        let mut rng = ChaCha8Rng::seed_from_u64(targets.seed ^ 0x9057);
        let walkers = u.iter().cycle().take(WALKERS).map(|u| {
            DVector::from_iterator(u.len(), u.iter().map(|u| u + APART * standard_normal(&mut rng)))
        });
        let walkers = walkers.collect();
        let keep = |sweep: usize| sweep >= BURN_IN && sweep.is_multiple_of(KEEP);
        let samples = sample(log_density, walkers, SWEEPS, keep, &mut rng);
        let normal = samples.into_iter().map(|u| u.as_slice().to_vec()).collect();
        Some(Self::of_samples(targets, likelihood, normal))
    }

    fn of_samples(targets: &Targets, likelihood: Likelihood, normal: Vec<Vec<f64>>) -> Self {
        let coordinates: Vec<Vec<f64>> = normal.iter().map(|u| targets.coordinates(u)).collect();
        let dimensions = targets.free.len();
        let samples: Vec<Vec<f64>> = normal.iter().map(|u| targets.values(u)).collect();
        let column = |samples: &[Vec<f64>], k: usize| -> Vec<f64> {
            samples.iter().map(|sample| sample[k]).collect()
        };
        let moments: Vec<[f64; 2]> =
            (0..dimensions).map(|k| moments(&column(&samples, k))).collect();
        let of_normal: Vec<[f64; 2]> =
            (0..dimensions).map(|k| self::moments(&column(&normal, k))).collect();
        let correlation = DMatrix::from_fn(dimensions, dimensions, |i, j| {
            let ([a, sa], [b, sb]) = (of_normal[i], of_normal[j]);
            let products = normal.iter().map(|u| (u[i] - a) * (u[j] - b));
            products.sum::<f64>() / (normal.len() as f64 * sa * sb)
        });
        let determined = of_normal.iter().map(|&[_, sd]| match sd {
            sd if sd < WELL => Determined::Well,
            sd if sd < WEAKLY => Determined::Weakly,
            _ => Determined::Not,
        });
        let determined = determined.collect();
        let predictions: Vec<Vec<f64>> = coordinates
            .iter()
            .map(|x| likelihood.emulator().predict(x).as_slice().to_vec())
            .collect();
        let predicted = (0..targets.observed().len()).map(|k| {
            let values = column(&predictions, k);
            let [low, high] = interval(&values);
            [self::moments(&values)[0], low, high]
        });
        Self {
            mean: moments.iter().map(|m| m[0]).collect(),
            sd: moments.iter().map(|m| m[1]).collect(),
            interval: (0..dimensions).map(|k| interval(&column(&samples, k))).collect(),
            correlation,
            determined,
            predicted: predicted.collect(),
            samples,
            fit: coordinates.iter().map(|x| likelihood.log(x)).collect(),
            likelihood,
        }
    }

    /// Share of the posterior under which the measurements are more likely than under these values: the values are
    /// within the 95 % region if it is below 0.95.
    ///
    /// That region has the largest ratio of posterior to prior. It does not depend on the variables that stand for the
    /// parameters, and reaches to the ends of their ranges: an ellipsoid around the mean of the normal variables, which
    /// are infinite there, would not.
    pub fn level(&self, targets: &Targets, values: &[f64]) -> f64 {
        let u: Vec<f64> =
            targets.free.iter().zip(values).map(|(free, &value)| free.normal(value)).collect();
        let fit = self.likelihood.log(&targets.coordinates(&u));
        let better = self.fit.iter().filter(|&&other| other > fit).count();
        better as f64 / self.fit.len() as f64
    }

    /// What the tests determine, in words.
    pub fn identifiability(&self, targets: &Targets) -> Vec<String> {
        let mut lines = Vec::new();
        for ((free, determined), [low, high]) in
            targets.free.iter().zip(&self.determined).zip(&self.interval)
        {
            let (low, high) = (plot::number(*low), plot::number(*high));
            lines.push(match determined {
                Determined::Well => format!("{} is determined: {low} to {high}.", free.key),
                Determined::Weakly => {
                    format!("{} is weakly determined: {low} to {high}.", free.key)
                }
                Determined::Not => format!("{} is not determined by these tests.", free.key),
            });
        }
        for i in 0..targets.free.len() {
            for j in 0..i {
                let r = self.correlation[(i, j)];
                if r.abs() >= TOGETHER {
                    let (a, b) = (&targets.free[j].key, &targets.free[i].key);
                    let how = if r > 0.0 { "rise together" } else { "replace each other" };
                    lines.push(format!("{a} and {b} {how} (correlation {r:.2})."));
                }
            }
        }
        lines
    }
}

/// Mean and standard deviation.
fn moments(values: &[f64]) -> [f64; 2] {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n;
    [mean, variance.sqrt()]
}

/// 2.5 % and 97.5 % quantiles.
fn interval(values: &[f64]) -> [f64; 2] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    [0.025, 0.975].map(|share| sorted[(share * (sorted.len() - 1) as f64).round() as usize])
}
