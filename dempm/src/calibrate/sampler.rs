//! Samples of a distribution whose density is known but for a factor.

use nalgebra::DVector;
use rand::{Rng, RngExt};

/// Most stretch of a move, the parameter a of the method.
const STRETCH: f64 = 2.0;

/// The affine-invariant sampler of Goodman & Weare (2010), Commun. Appl. Math. Comput. Sci. 5, 65: each walker of one
/// half moves along the line to a walker of the other half, chosen at random. `keep` tells which of the sweeps over all
/// walkers are samples.
pub(super) fn sample(
    log_density: impl Fn(&DVector<f64>) -> f64,
    mut walkers: Vec<DVector<f64>>,
    sweeps: usize,
    keep: impl Fn(usize) -> bool,
    rng: &mut impl Rng,
) -> Vec<DVector<f64>> {
    let mut density: Vec<f64> = walkers.iter().map(&log_density).collect();
    let mut samples = Vec::new();
    let half = walkers.len() / 2;
    for sweep in 0..sweeps {
        for k in 0..walkers.len() {
            let other = if k < half {
                rng.random_range(half..walkers.len())
            } else {
                rng.random_range(0..half)
            };
            // The density of z is 1 / sqrt(z) between 1 / a and a.
            let uniform: f64 = rng.random();
            let z = (1.0 + (STRETCH - 1.0) * uniform).powi(2) / STRETCH;
            let next = &walkers[other] + z * (&walkers[k] - &walkers[other]);
            let next_density = log_density(&next);
            let dimensions = next.len() as f64;
            let ratio = (dimensions - 1.0) * z.ln() + next_density - density[k];
            if rng.random::<f64>().ln() < ratio {
                (walkers[k], density[k]) = (next, next_density);
            }
        }
        if keep(sweep) {
            samples.extend(walkers.iter().cloned());
        }
    }
    samples
}

#[cfg(test)]
mod tests {
    use nalgebra::dvector;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// A normal distribution of standard deviations 0.1 and 2 and correlation 0.9. Samples are correlated over some
    /// 30 sweeps: 100 walkers in 1000 sweeps are some 3000 independent ones, and know a variance to 3 %.
    #[test]
    fn a_narrow_normal_distribution_has_its_moments() {
        let [a, b, r] = [0.1, 2.0, 0.9];
        let log_density = |x: &DVector<f64>| {
            let (u, v) = ((x[0] - 1.0) / a, x[1] / b);
            -0.5 * (u * u - 2.0 * r * u * v + v * v) / (1.0 - r * r)
        };
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let walkers = (0..100).map(|_| dvector![rng.random(), rng.random()]).collect();
        let samples = sample(log_density, walkers, 1300, |sweep| sweep >= 300, &mut rng);
        let mean = |f: &dyn Fn(&DVector<f64>) -> f64| {
            samples.iter().map(f).sum::<f64>() / samples.len() as f64
        };
        assert!((mean(&|x| x[0]) - 1.0).abs() < 0.1 * a && mean(&|x| x[1]).abs() < 0.1 * b);
        assert!((mean(&|x| (x[0] - 1.0).powi(2)) / (a * a) - 1.0).abs() < 0.1);
        assert!((mean(&|x| (x[0] - 1.0) * x[1]) / (a * b) - r).abs() < 0.1);
    }
}
