//! What the tests tell about the parameters: samples of the posterior, by the algorithm of Metropolis.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::emulator::Emulator;
use super::ensemble::standard_normal;
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
    /// Samples of standard normal variables.
    normal: Vec<Vec<f64>>,
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

const STEPS: usize = 60_000;
const BURN_IN: usize = 10_000;
const KEEP: usize = 25;
/// Posterior over prior standard deviation below which a parameter is well, and weakly, determined.
const WELL: f64 = 1.0 / 3.0;
const WEAKLY: f64 = 2.0 / 3.0;
/// Correlation from which two parameters are determined together only.
const TOGETHER: f64 = 0.8;

impl Posterior {
    /// Samples from near the parameters `u` of an ensemble, one column each. The likelihood has the standard
    /// deviations of the targets and the residuals of the emulator. `None` if they make no covariance.
    pub fn sample(targets: &Targets, emulator: &Emulator, u: &DMatrix<f64>) -> Option<Self> {
        let y = DVector::from_vec(targets.observed());
        let sd = DVector::from_vec(targets.deviations());
        let likelihood =
            (DMatrix::from_diagonal(&sd.component_mul(&sd)) + &emulator.residuals).cholesky()?;
        let log_density = |u: &DVector<f64>| {
            let misfit = &y - emulator.predict(u.as_slice());
            -0.5 * (u.norm_squared() + misfit.dot(&likelihood.solve(&misfit)))
        };
        let dimensions = u.nrows();
        let mean = u.column_mean();
        let differences = DMatrix::from_fn(dimensions, u.ncols(), |i, k| u[(i, k)] - mean[i]);
        let spread = &differences * differences.transpose() / (u.ncols() - 1) as f64;
        let step = (spread + DMatrix::identity(dimensions, dimensions) * 1.0e-6).cholesky()?.l()
            * (2.38 / (dimensions as f64).sqrt());

        let mut rng = ChaCha8Rng::seed_from_u64(targets.seed ^ 0x9057);
        let (mut now, mut density) = (mean.clone(), log_density(&mean));
        let mut normal = Vec::new();
        for n in 0..STEPS {
            let jump = DVector::from_fn(dimensions, |_, _| standard_normal(&mut rng));
            let next = &now + &step * jump;
            let next_density = log_density(&next);
            if (next_density - density).exp() > rng.random::<f64>() {
                (now, density) = (next, next_density);
            }
            if n >= BURN_IN && n % KEEP == 0 {
                normal.push(now.as_slice().to_vec());
            }
        }
        Some(Self::of_samples(targets, emulator, normal))
    }

    fn of_samples(targets: &Targets, emulator: &Emulator, normal: Vec<Vec<f64>>) -> Self {
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
        let predictions: Vec<Vec<f64>> =
            normal.iter().map(|u| emulator.predict(u).as_slice().to_vec()).collect();
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
            normal,
        }
    }

    /// Share of the posterior that lies closer to its centre than these values, by the distance of Mahalanobis: the
    /// values are within the 95 % region if it is below 0.95. `None` for a posterior without width.
    pub fn level(&self, targets: &Targets, values: &[f64]) -> Option<f64> {
        let samples = DMatrix::from_fn(values.len(), self.normal.len(), |i, k| self.normal[k][i]);
        let mean = samples.column_mean();
        let differences =
            DMatrix::from_fn(values.len(), self.normal.len(), |i, k| samples[(i, k)] - mean[i]);
        let covariance = &differences * differences.transpose() / self.normal.len() as f64;
        let inverse = covariance.cholesky()?;
        let distance = |u: &DVector<f64>| {
            let d = u - &mean;
            d.dot(&inverse.solve(&d))
        };
        let u: Vec<f64> =
            targets.free.iter().zip(values).map(|(free, &value)| free.normal(value)).collect();
        let far = distance(&DVector::from_vec(u));
        let closer = samples.column_iter().filter(|u| distance(&u.clone_owned()) < far).count();
        Some(closer as f64 / self.normal.len() as f64)
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
