//! How likely the measurements are for given parameters.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::emulator::Emulator;

/// The likelihood of the measurements, in the combinations of them that the parameters change most.
///
/// There are as many combinations as parameters, and one more. In all directions of the measurements, the likelihood
/// would count on those where residuals happen to be smallest: truths were then missed twice as often.
///
/// In these combinations the predictive distribution of a regression of unknown coefficients and covariance is one of
/// Student (Zellner 1971, An introduction to Bayesian inference in econometrics, 8.3): with $\nu$ the simulations less
/// the coefficients, the residuals $\Sigma$, the leverage $h$ of the parameters and $k$ combinations,
///
/// $$ p \propto (1 + h)^{-k/2} \left(1 + \frac{r^T \Sigma^{-1} r}{\nu (1 + h)}\right)^{-(\nu + 1)/2}. $$
///
/// The variances of the measurements are added to $\Sigma$.
#[derive(Clone, Debug)]
pub(super) struct Likelihood {
    emulator: Emulator,
    coefficients: DMatrix<f64>,
    observed: DVector<f64>,
    covariance: Cholesky<f64, Dyn>,
}

/// Part of the covariances between residuals that is taken for sampling noise where combinations are chosen.
const SHRINKAGE: f64 = 0.5;

impl Likelihood {
    /// Of measurements with standard deviations. `None` if they make no covariance that can be inverted.
    pub fn new(
        emulator: Emulator,
        observed: &[f64],
        sd: &[f64],
        parameters: usize,
    ) -> Option<Self> {
        let variances =
            DMatrix::from_diagonal(&DVector::from_iterator(sd.len(), sd.iter().map(|sd| sd * sd)));
        let noise = (1.0 - SHRINKAGE) * &emulator.residuals
            + SHRINKAGE * DMatrix::from_diagonal(&emulator.residuals.diagonal())
            + &variances;
        // Largest changes over noise: principal axes where the noise is a unit sphere.
        let noise = noise.cholesky()?.l();
        let half = noise.solve_lower_triangular(&emulator.changes)?;
        let white = noise.solve_lower_triangular(&half.transpose())?;
        let axes = white.symmetric_eigen();
        let mut order: Vec<usize> = (0..sd.len()).collect();
        order.sort_by(|&a, &b| axes.eigenvalues[b].total_cmp(&axes.eigenvalues[a]));
        order.truncate(parameters + 1);
        let chosen = axes.eigenvectors.select_columns(&order);
        let combinations = noise.tr_solve_lower_triangular(&chosen)?;
        let covariance = combinations.tr_mul(&((&emulator.residuals + variances) * &combinations));
        Some(Self {
            coefficients: &emulator.coefficients * &combinations,
            observed: combinations.tr_mul(&DVector::from_column_slice(observed)),
            covariance: covariance.cholesky()?,
            emulator,
        })
    }

    /// Its logarithm at the coordinates of parameters, but for a constant.
    pub fn log(&self, x: &[f64]) -> f64 {
        let terms = self.emulator.terms(x);
        let misfit = &self.observed - self.coefficients.tr_mul(&terms);
        let spread = 1.0 + self.emulator.leverage(&terms);
        let degrees = self.emulator.degrees;
        let square = misfit.dot(&self.covariance.solve(&misfit)) / (degrees * spread);
        -0.5 * (misfit.len() as f64 * spread.ln() + (degrees + 1.0) * square.ln_1p())
    }

    /// The emulator, of all measurements.
    pub fn emulator(&self) -> &Emulator {
        &self.emulator
    }
}
