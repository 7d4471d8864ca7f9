//! Ridge regression on standardised features.

use dempm::choose::Standardisation;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// `y = intercept + sum of w_k z_k` with standardised features `z`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Regression {
    #[serde(flatten)]
    scale: Standardisation,
    /// Mean of the answers.
    intercept: f64,
    /// One weight for each feature.
    weights: Vec<f64>,
}

impl Regression {
    /// Minimises `|y - f(x)|² + penalty |w|²` over rows `x` and answers `y`; `None` without rows or if the matrix is
    /// singular.
    pub fn fit(rows: &[&[f64]], answers: &[f64], penalty: f64) -> Option<Self> {
        let features = rows.first()?.len();
        let scale = Standardisation::of(rows);
        let intercept = answers.iter().sum::<f64>() / rows.len() as f64;
        let scaled: Vec<f64> = rows.iter().flat_map(|row| scale.apply(row)).collect();
        let x = DMatrix::from_row_slice(rows.len(), features, &scaled);
        let y = DVector::from_iterator(rows.len(), answers.iter().map(|answer| answer - intercept));
        let normal = x.tr_mul(&x) + penalty * DMatrix::identity(features, features);
        let weights = normal.cholesky()?.solve(&x.tr_mul(&y));
        Some(Self { scale, intercept, weights: weights.iter().copied().collect() })
    }

    /// The answer at a row.
    pub fn at(&self, row: &[f64]) -> f64 {
        let terms = self.scale.apply(row);
        self.intercept + terms.iter().zip(&self.weights).map(|(z, w)| z * w).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y = 3 + 2 a - b on a grid, with a third feature that does not vary.
    fn data() -> (Vec<[f64; 3]>, Vec<f64>) {
        let grid = (0..6).flat_map(|a| (0..5).map(move |b| [f64::from(a), f64::from(b), 7.0]));
        let rows: Vec<[f64; 3]> = grid.collect();
        let answers = rows.iter().map(|[a, b, _]| 3.0 + 2.0 * a - b).collect();
        (rows, answers)
    }

    #[test]
    fn a_linear_function_is_found_without_penalty() {
        let (rows, answers) = data();
        let rows: Vec<&[f64]> = rows.iter().map(|row| &row[..]).collect();
        // A constant feature would make the matrix singular but for a little penalty.
        let found = Regression::fit(&rows, &answers, 1e-9).unwrap();
        for (a, b) in [(1.5, 2.5), (-1.0, 9.0)] {
            // Error by the penalty: 1e-9 / 30 rows of the weights.
            assert!((found.at(&[a, b, 7.0]) - (3.0 + 2.0 * a - b)).abs() < 1e-8);
        }
    }

    #[test]
    fn a_large_penalty_leaves_the_mean() {
        let (rows, answers) = data();
        let rows: Vec<&[f64]> = rows.iter().map(|row| &row[..]).collect();
        let mean = answers.iter().sum::<f64>() / answers.len() as f64;
        let found = Regression::fit(&rows, &answers, 1e12).unwrap();
        assert!((found.at(&[5.0, 4.0, 7.0]) - mean).abs() < 1e-8);
        assert_eq!(Regression::fit(&[], &[], 1.0), None);
    }
}
