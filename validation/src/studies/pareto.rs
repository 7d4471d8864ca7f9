//! Speed against accuracy: the Pareto front and fair comparisons.
//!
//! After McGreivy and Hakim (Nature Machine Intelligence 6, 2024): methods are compared at equal
//! accuracy or at equal time, and with the most efficient setting of a rival, not with its finest.

/// The cost and the error of a method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// Wall time, s.
    pub seconds: f64,
    /// Any measure of error; smaller is better.
    pub error: f64,
}

/// Indices of the entries that no other beats in both time and error, by time. Errors below `floor`
/// count as equal.
pub fn front(costs: &[Cost], floor: f64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..costs.len()).filter(|&k| usable(&costs[k])).collect();
    order.sort_by(|&a, &b| {
        let [a, b] = [costs[a], costs[b]];
        a.seconds.total_cmp(&b.seconds).then(a.error.total_cmp(&b.error))
    });
    let mut best = f64::INFINITY;
    order.retain(|&k| {
        let error = costs[k].error.max(floor);
        let better = error < best;
        best = best.min(error);
        better
    });
    order
}

/// Index of the cheapest rival that is as accurate as `method`; errors below `floor` count as equal.
pub fn as_accurate(method: Cost, rivals: &[Cost], floor: f64) -> Option<usize> {
    let accurate = |cost: &Cost| usable(cost) && cost.error <= method.error.max(floor);
    let found = (0..rivals.len()).filter(|&k| accurate(&rivals[k]));
    found.min_by(|&a, &b| rivals[a].seconds.total_cmp(&rivals[b].seconds))
}

/// Index of the most accurate rival that takes no longer than `method`.
pub fn as_fast(method: Cost, rivals: &[Cost]) -> Option<usize> {
    let fast = |cost: &Cost| usable(cost) && cost.seconds <= method.seconds;
    let found = (0..rivals.len()).filter(|&k| fast(&rivals[k]));
    found.min_by(|&a, &b| rivals[a].error.total_cmp(&rivals[b].error))
}

/// Number of runs after which an `investment` (s) has paid back, if a run takes `ours` instead of
/// `theirs` (s); `None` if never.
pub fn break_even(investment: f64, ours: f64, theirs: f64) -> Option<f64> {
    (theirs > ours).then(|| (investment / (theirs - ours)).ceil())
}

fn usable(cost: &Cost) -> bool {
    cost.seconds.is_finite() && cost.error.is_finite()
}

#[cfg(test)]
mod tests {
    use super::*;

    const COSTS: [Cost; 5] = [
        Cost { seconds: 10.0, error: 1e-3 },
        Cost { seconds: 1.0, error: 1e-1 },
        Cost { seconds: 5.0, error: 1e-1 },
        Cost { seconds: 20.0, error: 2e-4 },
        Cost { seconds: 2.0, error: f64::INFINITY },
    ];

    #[test]
    fn the_front_has_what_nothing_beats() {
        assert_eq!(front(&COSTS, 0.0), [1, 0, 3]);
        // Within the noise the finest is no better than the next one.
        assert_eq!(front(&COSTS, 1e-3), [1, 0]);
        assert_eq!(front(&[], 0.0), [0; 0]);
    }

    #[test]
    fn rivals_are_the_cheapest_as_accurate_and_the_best_as_fast() {
        let method = Cost { seconds: 6.0, error: 5e-3 };
        assert_eq!(as_accurate(method, &COSTS, 0.0), Some(0));
        assert_eq!(as_fast(method, &COSTS), Some(1));
        let better = Cost { seconds: 0.5, error: 1e-5 };
        assert_eq!((as_accurate(better, &COSTS, 0.0), as_fast(better, &COSTS)), (None, None));
        // An error below the noise is matched by any that is.
        assert_eq!(as_accurate(better, &COSTS, 2e-4), Some(3));
    }

    #[test]
    fn an_investment_pays_back_only_if_runs_get_cheaper() {
        assert_eq!(break_even(100.0, 1.0, 11.0), Some(10.0));
        assert_eq!(break_even(95.0, 1.0, 11.0), Some(10.0));
        assert_eq!(break_even(100.0, 2.0, 2.0), None);
    }
}
