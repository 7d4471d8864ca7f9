//! Distances between squares of material.

/// Mean of |a - b|² over corresponding positions, m²; NaN of nothing.
pub(super) fn mean_square(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    let square = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
    a.iter().zip(b).map(square).sum::<f64>() / a.len() as f64
}

/// Mean of a symmetric function over all pairs of different entries; `None` of fewer than two.
pub(super) fn mean_over_pairs<T>(all: &[T], of: impl Fn(&T, &T) -> f64) -> Option<f64> {
    let pairs = || (0..all.len()).flat_map(|j| (0..j).map(move |k| (j, k)));
    let sum: f64 = pairs().map(|(j, k)| of(&all[j], &all[k])).sum();
    (all.len() > 1).then(|| sum / pairs().count() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_moved_by_a_vector_are_as_far_as_it_is_long() {
        let start: Vec<[f64; 2]> =
            (0..10).map(|k| [f64::from(k), 0.5 * f64::from(k * k)]).collect();
        let moved: Vec<[f64; 2]> = start.iter().map(|[x, y]| [x + 0.3, y - 0.4]).collect();
        assert!((mean_square(&start, &moved).sqrt() - 0.5).abs() < 1e-12);
    }

    #[test]
    fn every_pair_counts_once() {
        let difference = |a: &f64, b: &f64| (a - b).abs();
        assert_eq!(mean_over_pairs(&[0.0, 1.0, 3.0], difference), Some(2.0));
        assert_eq!(mean_over_pairs(&[1.0], difference), None);
    }
}
