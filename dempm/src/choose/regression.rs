//! Ridge regression on standardised features.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Least standard deviation of a feature that varies.
const CONSTANT: f64 = 1.0e-9;

/// `y = intercept + sum of w_k z_k` with `z = (x - mean) / deviation`, and products of two `z` where given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Regression {
    /// Mean of each feature.
    mean: Vec<f64>,
    /// Standard deviation of each feature; 0 of one that does not vary.
    deviation: Vec<f64>,
    /// Pairs of features whose products are terms.
    products: Vec<[usize; 2]>,
    /// Mean of the answers.
    intercept: f64,
    /// One weight for each feature, then for each product.
    weights: Vec<f64>,
}

impl Regression {
    /// Minimises `|y - f(x)|² + penalty |w|²` over rows `x` and answers `y`; `None` without rows or if the matrix is
    /// singular.
    pub fn fit(
        rows: &[&[f64]],
        answers: &[f64],
        products: &[[usize; 2]],
        penalty: f64,
    ) -> Option<Self> {
        let count = rows.len() as f64;
        let features = rows.first()?.len();
        let column = |k: usize| rows.iter().map(move |row| row[k]);
        let mean: Vec<f64> = (0..features).map(|k| column(k).sum::<f64>() / count).collect();
        let deviation = |k: usize| {
            let squares: f64 = column(k).map(|x| (x - mean[k]).powi(2)).sum();
            let deviation = (squares / count).sqrt();
            if deviation > CONSTANT { deviation } else { 0.0 }
        };
        let deviation: Vec<f64> = (0..features).map(deviation).collect();
        let intercept = answers.iter().sum::<f64>() / count;
        let varies = |[a, b]: &&[usize; 2]| deviation[*a] > 0.0 && deviation[*b] > 0.0;
        let products = products.iter().filter(varies).copied().collect();
        let mut found = Self { mean, deviation, products, intercept, weights: Vec::new() };
        let terms: Vec<Vec<f64>> = rows.iter().map(|row| found.terms(row)).collect();
        let x = DMatrix::from_fn(rows.len(), terms[0].len(), |i, k| terms[i][k]);
        let y = DVector::from_iterator(rows.len(), answers.iter().map(|answer| answer - intercept));
        let normal = x.tr_mul(&x) + penalty * DMatrix::identity(x.ncols(), x.ncols());
        let weights = normal.cholesky()?.solve(&x.tr_mul(&y));
        found.weights = weights.iter().copied().collect();
        Some(found)
    }

    /// The answer at a row.
    pub fn at(&self, row: &[f64]) -> f64 {
        let terms = self.terms(row);
        self.intercept + terms.iter().zip(&self.weights).map(|(z, w)| z * w).sum::<f64>()
    }

    fn terms(&self, row: &[f64]) -> Vec<f64> {
        let scaled = |k: usize| {
            if self.deviation[k] > 0.0 { (row[k] - self.mean[k]) / self.deviation[k] } else { 0.0 }
        };
        let mut terms: Vec<f64> = (0..self.mean.len()).map(scaled).collect();
        let products: Vec<f64> = self.products.iter().map(|[a, b]| terms[*a] * terms[*b]).collect();
        terms.extend(products);
        terms
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y = 3 + 2 a - b + a b on a grid, with a third feature that does not vary.
    fn data() -> (Vec<[f64; 3]>, Vec<f64>) {
        let grid = (0..6).flat_map(|a| (0..5).map(move |b| [f64::from(a), f64::from(b), 7.0]));
        let rows: Vec<[f64; 3]> = grid.collect();
        let answers = rows.iter().map(|[a, b, _]| 3.0 + 2.0 * a - b + a * b).collect();
        (rows, answers)
    }

    #[test]
    fn a_bilinear_function_is_found_without_penalty() {
        let (rows, answers) = data();
        let rows: Vec<&[f64]> = rows.iter().map(|row| &row[..]).collect();
        // A constant feature would make the matrix singular but for a little penalty.
        let found = Regression::fit(&rows, &answers, &[[0, 1], [1, 2]], 1e-9).unwrap();
        for (a, b) in [(1.5, 2.5), (-1.0, 9.0)] {
            // Error by the penalty: 1e-9 / 30 rows of the weights.
            assert!((found.at(&[a, b, 7.0]) - (3.0 + 2.0 * a - b + a * b)).abs() < 1e-8);
        }
        assert_eq!(found.products, [[0, 1]]);
    }

    #[test]
    fn a_large_penalty_leaves_the_mean() {
        let (rows, answers) = data();
        let rows: Vec<&[f64]> = rows.iter().map(|row| &row[..]).collect();
        let mean = answers.iter().sum::<f64>() / answers.len() as f64;
        let found = Regression::fit(&rows, &answers, &[], 1e12).unwrap();
        assert!((found.at(&[5.0, 4.0, 7.0]) - mean).abs() < 1e-8);
        assert_eq!(Regression::fit(&[], &[], &[], 1.0), None);
    }
}
