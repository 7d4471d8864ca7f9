//! Ensemble Kalman inversion in a given number of steps: the ensemble smoother with multiple data assimilation of
//! Emerick & Reynolds (2013), Computers & Geosciences 55, 3.

use nalgebra::{DMatrix, DVector};
use rand::Rng;

/// A standard normal number, by the method of Box & Muller.
pub fn standard_normal(rng: &mut impl Rng) -> f64 {
    use rand::RngExt;
    let (a, b): (f64, f64) = (rng.random(), rng.random());
    (-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()
}

/// Mean of the columns, and their differences from it.
fn centred(columns: &DMatrix<f64>) -> (DVector<f64>, DMatrix<f64>) {
    let mean = columns.column_mean();
    let mut differences = columns.clone();
    for mut column in differences.column_iter_mut() {
        column -= &mean;
    }
    (mean, differences)
}

/// Moves an ensemble of parameters `u` (one column each), which predict `g`, towards the observations `y`:
///
/// $$ u_j \leftarrow u_j + C_{ug} (C_{gg} + \alpha \Gamma)^{-1}
/// (y + \sqrt{\alpha} \xi_j - g_j), \qquad \xi_j \sim N(0, \Gamma), $$
///
/// with the covariances of the ensemble and that of the observations $\Gamma$. As many steps as $\alpha$ amount to
/// one of Bayes' rule where predictions are linear. `None` if the covariances cannot be inverted.
pub fn update(
    u: &DMatrix<f64>,
    g: &DMatrix<f64>,
    y: &DVector<f64>,
    covariance: &DMatrix<f64>,
    alpha: f64,
    rng: &mut impl Rng,
) -> Option<DMatrix<f64>> {
    let degrees = (u.ncols() - 1) as f64;
    let (_, du) = centred(u);
    let (_, dg) = centred(g);
    let c_ug = &du * dg.transpose() / degrees;
    let c_gg = &dg * dg.transpose() / degrees;
    let gain = (c_gg + alpha * covariance).cholesky()?;
    let noise = covariance.clone().cholesky()?.l();
    let mut moved = u.clone();
    for (k, mut column) in moved.column_iter_mut().enumerate() {
        let xi = DVector::from_fn(y.len(), |_, _| standard_normal(rng));
        let misfit = y + alpha.sqrt() * (&noise * xi) - g.column(k);
        column += &c_ug * gain.solve(&misfit);
    }
    Some(moved)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Of a linear model y = A u + noise with a standard normal prior, the posterior has the covariance
    /// (1 + A^T A / s²)^-1 and the mean of it times A^T y / s². 4000 members: 1 / sqrt(4000) is 0.016.
    #[test]
    fn a_linear_model_has_its_posterior() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let a = DMatrix::from_row_slice(3, 2, &[1.0, 0.5, -0.3, 1.0, 0.7, 0.2]);
        let s = 0.4;
        let y = DVector::from_vec(vec![0.9, 0.4, 0.1]);
        let noise = DMatrix::identity(3, 3) * (s * s);
        let mut u = DMatrix::from_fn(2, 4000, |_, _| standard_normal(&mut rng));
        let rounds = 4;
        for _ in 0..rounds {
            let g = &a * &u;
            u = update(&u, &g, &y, &noise, f64::from(rounds), &mut rng).unwrap();
        }
        let covariance =
            (DMatrix::identity(2, 2) + a.transpose() * &a / (s * s)).try_inverse().unwrap();
        let mean = &covariance * a.transpose() * &y / (s * s);
        let (found, du) = centred(&u);
        let found_covariance = &du * du.transpose() / 3999.0;
        assert!((found - mean).norm() < 0.04);
        assert!((found_covariance - &covariance).norm() < 0.1 * covariance.norm());
    }
}
