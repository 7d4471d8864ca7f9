//! A quadratic model of the predictions over the parameters, fitted to simulations by least squares.
//!
//! Calibrate, emulate, sample (Cleary, Garbuno-Inigo, Lan, Schneider & Stuart 2021, J. Comput. Phys. 424, 109716):
//! the ensemble finds the region of the posterior, and there the emulator stands for simulations, without the scatter
//! between packings. That scatter, and what no quadratic model can follow, are its residuals.

use nalgebra::{DMatrix, DVector};

/// Predictions as quadratic functions of standard normal variables.
#[derive(Clone, Debug)]
pub struct Emulator {
    /// One column for each prediction.
    coefficients: DMatrix<f64>,
    /// Covariance of the residuals of simulations.
    pub residuals: DMatrix<f64>,
    quadratic: bool,
}

/// Simulations for every coefficient of a quadratic model, at least; with fewer it is linear.
const ENOUGH: usize = 2;
/// Part of the covariances between residuals that is taken for sampling noise.
const SHRINKAGE: f64 = 0.5;

impl Emulator {
    /// Fits simulations, of parameters `u` and predictions `g`, one column each. `None` for too few.
    pub fn fit(u: &DMatrix<f64>, g: &DMatrix<f64>) -> Option<Self> {
        let (dimensions, simulations) = u.shape();
        let quadratic = simulations >= ENOUGH * (dimensions + 1) * (dimensions + 2) / 2;
        let features = |k: usize| features(u.column(k).as_slice(), quadratic);
        let terms = features(0).len();
        let degrees = simulations.checked_sub(terms).filter(|&degrees| degrees > 0)?;
        let design = DMatrix::from_fn(simulations, terms, |k, term| features(k)[term]);
        let coefficients = design.clone().svd(true, true).solve(&g.transpose(), 1.0e-10).ok()?;
        let rest = g.transpose() - design * &coefficients;
        let mut residuals = rest.transpose() * &rest / degrees as f64;
        for (i, j) in (0..g.nrows()).flat_map(|i| (0..i).map(move |j| (i, j))) {
            residuals[(i, j)] *= 1.0 - SHRINKAGE;
            residuals[(j, i)] = residuals[(i, j)];
        }
        Some(Self { coefficients, residuals, quadratic })
    }

    /// The predictions.
    pub fn predict(&self, u: &[f64]) -> DVector<f64> {
        self.coefficients.transpose() * DVector::from_vec(features(u, self.quadratic))
    }
}

/// 1, the variables and, of a quadratic model, their products.
fn features(u: &[f64], quadratic: bool) -> Vec<f64> {
    let mut features = vec![1.0];
    features.extend(u);
    if quadratic {
        features.extend((0..u.len()).flat_map(|i| (i..u.len()).map(move |j| u[i] * u[j])));
    }
    features
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::calibrate::ensemble::standard_normal;

    /// A quadratic function with noise of 0.1: of 200 simulations, residuals are known to 1 / sqrt(400), 5 %, and
    /// predictions to some 0.1 / sqrt(200).
    #[test]
    fn a_quadratic_function_is_found_under_noise() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let f = |u: &[f64]| 1.0 + 2.0 * u[0] - u[1] + 0.5 * u[0] * u[1] - 0.3 * u[1] * u[1];
        let u = DMatrix::from_fn(2, 200, |_, _| standard_normal(&mut rng));
        let g = DMatrix::from_fn(1, 200, |_, k| {
            f(u.column(k).as_slice()) + 0.1 * standard_normal(&mut rng)
        });
        let emulator = Emulator::fit(&u, &g).unwrap();
        assert!((emulator.residuals[(0, 0)].sqrt() - 0.1).abs() < 0.02);
        for u in [[0.0, 0.0], [1.0, -0.5], [-1.0, 1.0]] {
            assert!((emulator.predict(&u)[0] - f(&u)).abs() < 0.05);
        }
        assert!(
            Emulator::fit(&u.columns(0, 3).into_owned(), &g.columns(0, 3).into_owned()).is_none()
        );
    }
}
