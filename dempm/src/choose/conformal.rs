//! Bounds from the errors of predictions that were made without knowing the answer.

/// The quantile of `errors` that a further one, drawn alike, does not exceed with at least the probability `level`:
/// the `ceil((n + 1) level)`-th smallest (Vovk, Gammerman and Shafer 2005); the largest if there are too few.
pub fn quantile(errors: &[f64], level: f64) -> Option<f64> {
    let mut sorted = errors.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = ((sorted.len() + 1) as f64 * level).ceil() as usize;
    sorted.get(rank.clamp(1, sorted.len().max(1)) - 1).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of n errors from one distribution, the last is below the quantile of the others in
    /// `ceil(n level) / n` of all orders.
    #[test]
    fn the_share_below_is_the_level() {
        let errors: Vec<f64> = (0..100).map(|k| f64::from(k * 37 % 100)).collect();
        let below = (0..errors.len()).filter(|&last| {
            let mut others = errors.clone();
            let error = others.remove(last);
            error <= quantile(&others, 0.9).unwrap()
        });
        assert_eq!(below.count(), 90);
    }

    #[test]
    fn few_errors_give_the_largest() {
        assert_eq!(quantile(&[2.0, 1.0], 0.9), Some(2.0));
        assert_eq!(quantile(&[], 0.9), None);
    }
}
