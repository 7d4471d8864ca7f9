//! Numbers on axes: ranges, ticks and their text.

/// The part of the values that the colours span, in the scale of the values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Range {
    pub low: f64,
    pub high: f64,
    /// Some values lie below `low` or above `high`.
    pub cut: [bool; 2],
}

/// The share of the values at either end that do not stretch the range.
const TAIL: f64 = 0.01;

impl Range {
    /// The range of the finite `values` without the extreme hundredth at either end, which a
    /// handful of flying points would otherwise own.
    pub(super) fn robust(values: impl Iterator<Item = f64>, signed: bool) -> Self {
        let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        let (Some(&least), Some(&most)) = (values.first(), values.last()) else {
            return Self { low: 0.0, high: 1.0, cut: [false; 2] };
        };
        let at = |share: f64| values[((values.len() - 1) as f64 * share).round() as usize];
        let (mut low, mut high) = (at(TAIL), at(1.0 - TAIL));
        if signed {
            high = low.abs().max(high.abs());
            low = -high;
        } else if low > 0.0 && low < 0.25 * high {
            // Zero is worth showing where it is near.
            low = 0.0;
        }
        if high - low <= 1e-12 * high.abs().max(low.abs()) {
            let half = if high == 0.0 { 0.5 } else { 0.05 * high.abs() };
            (low, high) = (low - half, high + half);
        }
        Self { low, high, cut: [least < low, most > high] }
    }

    /// As [`robust`](Self::robust), of the logarithms (base 10) of the positive values.
    pub(super) fn robust_log(values: impl Iterator<Item = f64>) -> Self {
        let logarithms: Vec<f64> = values.filter(|&v| v > 0.0).map(f64::log10).collect();
        let mut range = Self::robust(logarithms.iter().copied(), false);
        if range.low == 0.0 && range.high > 0.0 {
            // Zero is no special logarithm.
            let least = logarithms.iter().copied().fold(f64::INFINITY, f64::min);
            range.low = least.min(range.high - 1.0);
        }
        range
    }

    /// Where `value` lies between low (0) and high (1).
    pub(super) fn fraction(&self, value: f64) -> f64 {
        ((value - self.low) / (self.high - self.low)).clamp(0.0, 1.0)
    }
}

/// Round numbers, about `wanted` of them, from `low` to `high`.
pub(super) fn ticks(low: f64, high: f64, wanted: f64) -> Vec<f64> {
    let rough = (high - low) / wanted.max(1.0);
    if !(rough.is_finite() && rough > 0.0) {
        return Vec::new();
    }
    let power = 10_f64.powf(rough.log10().floor());
    let step = power
        * match rough / power {
            ratio if ratio <= 1.0 => 1.0,
            ratio if ratio <= 2.0 => 2.0,
            ratio if ratio <= 5.0 => 5.0,
            _ => 10.0,
        };
    let slack = 1e-9 * (high - low);
    let first = ((low - slack) / step).ceil();
    let count = ((high + slack) / step).floor() - first;
    if !(0.0..=1000.0).contains(&count) {
        return Vec::new();
    }
    (0..=count as usize).map(|index| (first + index as f64) * step).collect()
}

/// The text of ticks, all with as many decimals as their step needs.
pub(super) fn tick_texts(ticks: &[f64]) -> Vec<String> {
    let step = match ticks {
        [first, second, ..] => second - first,
        _ => return ticks.iter().map(|tick| format!("{tick:.3}")).collect(),
    };
    let most = ticks.iter().fold(0.0_f64, |most, tick| most.max(tick.abs()));
    if !(1e-3..1e6).contains(&most) {
        return ticks.iter().map(|tick| minus(&format!("{tick:.1e}"))).collect();
    }
    let decimals = (-(step * 1.0001).log10().floor()).max(0.0) as usize;
    ticks.iter().map(|tick| minus(&format!("{:.decimals$}", tick + 0.0))).collect()
}

/// Typographic minus signs.
pub(super) fn minus(text: &str) -> String {
    text.replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_flying_point_does_not_own_the_range() {
        let values = (500..1500).map(f64::from).chain([1e9, f64::NAN]);
        let range = Range::robust(values, false);
        assert!(range.high < 1500.0 && range.low > 500.0);
        assert_eq!(range.cut, [true, true]);
        let signed = Range::robust([-1.0, 3.0].into_iter(), true);
        assert_eq!((signed.low, signed.high), (-3.0, 3.0));
    }

    #[test]
    fn degenerate_values_have_a_range() {
        for values in [vec![], vec![0.0], vec![7.0; 9], vec![f64::NAN], vec![-2.0]] {
            for range in [
                Range::robust(values.iter().copied(), false),
                Range::robust(values.iter().copied(), true),
                Range::robust_log(values.iter().copied()),
            ] {
                assert!(range.high > range.low, "{values:?}: {range:?}");
                assert!(!ticks(range.low, range.high, 5.0).is_empty());
            }
        }
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(tick_texts(&ticks(0.0, 7.6, 8.0)), ["0", "1", "2", "3", "4", "5", "6", "7"]);
        assert_eq!(tick_texts(&ticks(-0.1, 0.1, 4.0)), ["−0.10", "−0.05", "0.00", "0.05", "0.10"]);
        assert_eq!(tick_texts(&ticks(0.0, 4e6, 2.0)), ["0.0e0", "2.0e6", "4.0e6"]);
        assert!(ticks(0.0, f64::INFINITY, 5.0).is_empty());
    }
}
