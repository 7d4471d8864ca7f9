//! Means, spreads and ranges of measured values.

/// Arithmetic mean; NaN of nothing.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Sample standard deviation; NaN of fewer than two values.
pub fn deviation(values: &[f64]) -> f64 {
    let mean = mean(values);
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (squares / (values.len() as f64 - 1.0)).sqrt()
}

/// Smallest and largest value; `None` of nothing.
pub fn range(values: impl IntoIterator<Item = f64>) -> Option<[f64; 2]> {
    values.into_iter().fold(None, |range, value| {
        let [least, most] = range.unwrap_or([value; 2]);
        Some([f64::min(least, value), f64::max(most, value)])
    })
}

/// Factor and exponent of `y = c x^n`, by least squares of the logarithms.
pub fn power_law(points: &[(f64, f64)]) -> (f64, f64) {
    let [x, y]: [Vec<f64>; 2] =
        [points.iter().map(|p| p.0.ln()).collect(), points.iter().map(|p| p.1.ln()).collect()];
    let (x_mean, y_mean) = (mean(&x), mean(&y));
    let products = x.iter().zip(&y).map(|(x, y)| (x - x_mean) * (y - y_mean));
    let slope = products.sum::<f64>() / x.iter().map(|x| (x - x_mean).powi(2)).sum::<f64>();
    ((y_mean - slope * x_mean).exp(), slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_averaged() {
        assert_eq!((mean(&[1.0, 3.0]), deviation(&[1.0, 3.0])), (2.0, 2.0_f64.sqrt()));
        assert!(deviation(&[1.0]).is_nan());
        assert_eq!(range([2.0, 1.0, 3.0]), Some([1.0, 3.0]));
        assert_eq!(range([]), None);
    }

    #[test]
    fn a_power_law_is_recovered() {
        let points = [0.5, 1.0, 2.0, 4.0].map(|x: f64| (x, 1.7 * x.powf(1.3)));
        let (factor, exponent) = power_law(&points);
        assert!((factor - 1.7).abs() < 1e-12 && (exponent - 1.3).abs() < 1e-12);
    }
}
