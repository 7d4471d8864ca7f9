//! Features on a common scale.

use serde::{Deserialize, Serialize};

/// Least standard deviation of a feature that varies.
const CONSTANT: f64 = 1.0e-9;

/// `z = (x - mean) / deviation`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Standardisation {
    /// Mean of each feature.
    mean: Vec<f64>,
    /// Standard deviation of each feature; 0 of one that does not vary.
    deviation: Vec<f64>,
}

impl Standardisation {
    /// Of rows of equal length.
    pub fn of<R: AsRef<[f64]>>(rows: &[R]) -> Self {
        let features = rows.first().map_or(0, |row| row.as_ref().len());
        let over_rows = |f: &dyn Fn(&[f64]) -> f64| -> f64 {
            rows.iter().map(|row| f(row.as_ref())).sum::<f64>() / rows.len() as f64
        };
        let mean: Vec<f64> = (0..features).map(|k| over_rows(&|row| row[k])).collect();
        let deviation = |k: usize| {
            let deviation = over_rows(&|row| (row[k] - mean[k]).powi(2)).sqrt();
            if deviation > CONSTANT { deviation } else { 0.0 }
        };
        Self { deviation: (0..features).map(deviation).collect(), mean }
    }

    /// `z` of a row; 0 for a feature that does not vary.
    pub fn apply(&self, row: &[f64]) -> Vec<f64> {
        let scales = self.mean.iter().zip(&self.deviation);
        let scaled = |(x, (mean, deviation)): (&f64, (&f64, &f64))| {
            if *deviation > 0.0 { (x - mean) / deviation } else { 0.0 }
        };
        row.iter().zip(scales).map(scaled).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn features_get_mean_0_and_deviation_1_and_constants_are_0() {
        let found = Standardisation::of(&[[1.0, 7.0], [5.0, 7.0]]);
        assert_eq!(found.apply(&[1.0, 7.0]), [-1.0, 0.0]);
        assert_eq!(found.apply(&[9.0, 8.0]), [3.0, 0.0]);
    }
}
