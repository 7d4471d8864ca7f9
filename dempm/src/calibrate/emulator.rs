//! A quadratic model of the predictions over the parameters, fitted to simulations by least squares.
//!
//! Calibrate, emulate, sample (Cleary, Garbuno-Inigo, Lan, Schneider & Stuart 2021, J. Comput. Phys. 424, 109716):
//! the ensemble finds the region of the posterior, and there the emulator stands for simulations, without the scatter
//! between packings. That scatter, and what no quadratic model can follow, are its residuals.

use nalgebra::{DMatrix, DVector};

/// Predictions as quadratic functions of the [coordinates](super::Free::coordinate) of the parameters.
#[derive(Clone, Debug)]
pub struct Emulator {
    /// One column for each prediction.
    pub(super) coefficients: DMatrix<f64>,
    /// Covariance of the residuals of simulations.
    pub residuals: DMatrix<f64>,
    /// Covariance of the fitted values: what parameters change.
    pub(super) changes: DMatrix<f64>,
    /// Simulations less coefficients.
    pub(super) degrees: f64,
    /// Inverse of the products of the terms, summed over simulations.
    inverse: DMatrix<f64>,
    quadratic: bool,
}

/// Simulations for every coefficient of a quadratic model, at least; with fewer it is linear.
const ENOUGH: usize = 2;

impl Emulator {
    /// Fits simulations, of coordinates `x` and predictions `g`, one column each. `None` for too few.
    pub fn fit(x: &DMatrix<f64>, g: &DMatrix<f64>) -> Option<Self> {
        let (dimensions, simulations) = x.shape();
        let quadratic = simulations >= ENOUGH * (dimensions + 1) * (dimensions + 2) / 2;
        let terms = terms(&vec![0.0; dimensions], quadratic).len();
        let degrees = simulations.checked_sub(terms).filter(|&degrees| degrees > 0)? as f64;
        let mut design = DMatrix::zeros(simulations, terms);
        for (k, column) in x.column_iter().enumerate() {
            let row = DVector::from_vec(self::terms(column.clone_owned().as_slice(), quadratic));
            design.set_row(k, &row.transpose());
        }
        let coefficients = design.clone().svd(true, true).solve(&g.transpose(), 1.0e-10).ok()?;
        let mut fitted = &design * &coefficients;
        let rest = g.transpose() - &fitted;
        let mean = fitted.row_mean();
        fitted.row_iter_mut().for_each(|mut row| row -= &mean);
        Some(Self {
            residuals: rest.transpose() * &rest / degrees,
            changes: fitted.transpose() * &fitted / simulations as f64,
            inverse: (design.transpose() * &design).pseudo_inverse(1.0e-10).ok()?,
            coefficients,
            degrees,
            quadratic,
        })
    }

    /// The predictions.
    pub fn predict(&self, x: &[f64]) -> DVector<f64> {
        self.coefficients.tr_mul(&self.terms(x))
    }

    /// 1, the coordinates and, of a quadratic model, their products.
    pub(super) fn terms(&self, x: &[f64]) -> DVector<f64> {
        DVector::from_vec(terms(x, self.quadratic))
    }

    /// Variance of predictions over that of the residuals, from their terms: it grows away from the simulations.
    pub(super) fn leverage(&self, terms: &DVector<f64>) -> f64 {
        terms.dot(&(&self.inverse * terms))
    }
}

fn terms(x: &[f64], quadratic: bool) -> Vec<f64> {
    let mut terms = vec![1.0];
    terms.extend(x);
    if quadratic {
        terms.extend((0..x.len()).flat_map(|i| (i..x.len()).map(move |j| x[i] * x[j])));
    }
    terms
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
        let f = |x: &[f64]| 1.0 + 2.0 * x[0] - x[1] + 0.5 * x[0] * x[1] - 0.3 * x[1] * x[1];
        let x = DMatrix::from_fn(2, 200, |_, _| standard_normal(&mut rng));
        let g = DMatrix::from_fn(1, 200, |_, k| {
            f(x.column(k).as_slice()) + 0.1 * standard_normal(&mut rng)
        });
        let emulator = Emulator::fit(&x, &g).unwrap();
        assert!((emulator.residuals[(0, 0)].sqrt() - 0.1).abs() < 0.02);
        for x in [[0.0, 0.0], [1.0, -0.5], [-1.0, 1.0]] {
            assert!((emulator.predict(&x)[0] - f(&x)).abs() < 0.05);
        }
        // The mean of the leverage over the simulations is the number of terms over that of simulations.
        let leverage = |k: usize| emulator.leverage(&emulator.terms(x.column(k).as_slice()));
        let mean = (0..200).map(leverage).sum::<f64>() / 200.0;
        assert!((mean - 6.0 / 200.0).abs() < 1e-12);
        assert!(
            Emulator::fit(&x.columns(0, 3).into_owned(), &g.columns(0, 3).into_owned()).is_none()
        );
    }
}
