//! Ridge regression with a Gaussian kernel: smooth functions of many features from a few hundred cases.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::standardisation::Standardisation;

/// Factor of the squared distance of two standardised rows in the kernel. With the penalty, the best of twelve pairs by
/// five-fold cross-validation on the table that ships.
const DECAY: f64 = 0.02;
/// Penalty on the weights.
const PENALTY: f64 = 0.03;

/// Rows of features with the kernel `k(x, y) = exp(-DECAY |z(x) - z(y)|²)` of standardised features `z`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Rows {
    #[serde(flatten)]
    scale: Standardisation,
    /// Standardised.
    rows: Vec<Vec<f64>>,
}

/// `f(x) = intercept + sum of w_i k(x, x_i)` over the rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Regression {
    /// Mean of the answers.
    intercept: f64,
    /// One weight for each row; 0 of one without an answer.
    weights: Vec<f64>,
}

/// A regression, and how it fares without some of its rows.
pub(super) struct Fit {
    /// Of all rows with an answer.
    pub regression: Regression,
    /// Answer minus prediction of each of these, predicted without all rows of its group.
    pub left_out: Vec<f64>,
}

impl Rows {
    /// Rows of equal length.
    pub fn of<const N: usize>(rows: &[[f64; N]]) -> Self {
        let scale = Standardisation::of(rows);
        let rounded = |row: &[f64; N]| scale.apply(row).iter().map(|z| short(*z)).collect();
        Self { rows: rows.iter().map(rounded).collect(), scale }
    }

    /// The function that minimises `|y - f|² + PENALTY w K w` over the rows with an answer `y`. Predictions without a
    /// group `g` follow from the inverse `A` of `K + PENALTY` and the weights `w`: answers are off by
    /// `A_gg^-1 w_g`. `None` without answers.
    pub fn fit(&self, answers: &[Option<f64>], groups: &[usize]) -> Option<Fit> {
        let known: Vec<usize> = (0..answers.len()).filter(|&k| answers[k].is_some()).collect();
        let count = known.len();
        let given: Vec<f64> = answers.iter().flatten().copied().collect();
        let intercept = given.iter().sum::<f64>() / count.max(1) as f64;
        let matrix = DMatrix::from_fn(count, count, |i, j| {
            let diagonal = if i == j { PENALTY } else { 0.0 };
            kernel(&self.rows[known[i]], &self.rows[known[j]]) + diagonal
        });
        let inverse = matrix.cholesky()?.inverse();
        let answers = DVector::from_iterator(count, given.iter().map(|y| y - intercept));
        let solved = &inverse * answers;
        let mut left_out = vec![0.0; count];
        let mut names: Vec<usize> = known.iter().map(|&k| groups[k]).collect();
        names.sort_unstable();
        names.dedup();
        for group in names {
            let own: Vec<usize> = (0..count).filter(|&i| groups[known[i]] == group).collect();
            let block = DMatrix::from_fn(own.len(), own.len(), |i, j| inverse[(own[i], own[j])]);
            let weights = DVector::from_fn(own.len(), |i, _| solved[own[i]]);
            let off = block.cholesky()?.solve(&weights);
            own.iter().zip(off.iter()).for_each(|(&i, off)| left_out[i] = *off);
        }
        let mut weights = vec![0.0; self.rows.len()];
        known.iter().zip(solved.iter()).for_each(|(&k, weight)| weights[k] = short(*weight));
        (count > 0).then_some(Fit { regression: Regression { intercept, weights }, left_out })
    }

    /// The answer of a regression at a row.
    pub fn at(&self, regression: &Regression, row: &[f64]) -> f64 {
        let row = self.scale.apply(row);
        let terms = self.rows.iter().zip(&regression.weights);
        regression.intercept
            + terms.map(|(other, weight)| weight * kernel(&row, other)).sum::<f64>()
    }
}

fn kernel(a: &[f64], b: &[f64]) -> f64 {
    let square: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    (-DECAY * square).exp()
}

/// Four decimals: a short file.
fn short(x: f64) -> f64 {
    (1.0e4 * x).round() / 1.0e4
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y = 3 + 2 a - b + a b on a grid, with a third feature that does not vary; groups are lines of equal a.
    fn data() -> (Vec<[f64; 3]>, Vec<f64>, Vec<usize>) {
        let grid =
            (0..12).flat_map(|a| (0..12).map(move |b| (a, 0.5 * f64::from(a), 0.5 * f64::from(b))));
        let (mut rows, mut answers, mut groups) = (Vec::new(), Vec::new(), Vec::new());
        for (group, a, b) in grid {
            rows.push([a, b, 7.0]);
            answers.push(3.0 + 2.0 * a - b + a * b);
            groups.push(group as usize);
        }
        (rows, answers, groups)
    }

    #[test]
    fn a_smooth_function_is_found_between_its_rows() {
        let (rows, answers, groups) = data();
        let kernel = Rows::of(&rows);
        let answers: Vec<Option<f64>> = answers.into_iter().map(Some).collect();
        let found = kernel.fit(&answers, &groups).unwrap().regression;
        for (a, b) in [(1.7, 2.2), (3.1, 0.4)] {
            let expected = 3.0 + 2.0 * a - b + a * b;
            let found = kernel.at(&found, &[a, b, 7.0]);
            // The penalty takes one per cent of the largest answer, 40.
            assert!((found - expected).abs() < 0.4, "{found} {expected}");
        }
    }

    /// What follows from the inverse is what fits without each group give; rows without an answer are as absent.
    #[test]
    fn leaving_groups_out_is_fitting_without_them() {
        let (rows, answers, groups) = data();
        let kernel = Rows::of(&rows);
        let unknown = |k: usize| k % 7 == 3;
        let answer = |k: usize| (!unknown(k)).then_some(answers[k]);
        let all: Vec<Option<f64>> = (0..rows.len()).map(answer).collect();
        let whole = kernel.fit(&all, &groups).unwrap();
        let without = |group: usize| -> Vec<Option<f64>> {
            (0..rows.len()).map(|k| answer(k).filter(|_| groups[k] != group)).collect()
        };
        let known = (0..rows.len()).filter(|k| !unknown(*k));
        for (k, left_out) in known.zip(&whole.left_out) {
            let fit = kernel.fit(&without(groups[k]), &groups).unwrap().regression;
            // The mean of the answers stays that of all.
            let shifted = Regression { intercept: whole.regression.intercept, ..fit.clone() };
            let shift = kernel.at(&shifted, &rows[k]) - kernel.at(&fit, &rows[k]);
            let expected = answers[k] - kernel.at(&fit, &rows[k]);
            assert!((left_out - expected).abs() < 0.1 + shift.abs(), "{left_out} {expected}");
        }
        assert!(kernel.fit(&vec![None; rows.len()], &groups).is_none());
    }
}
