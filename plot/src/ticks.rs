//! Ticks of axes and their text.

/// About `wanted` round numbers from `low` to `high`; none if that is no interval.
pub fn ticks(low: f64, high: f64, wanted: f64) -> Vec<f64> {
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

/// Ticks of a logarithmic axis from `low` to `high`, both positive: 1, 2 and 5 of every decade, on longer axes powers of
/// ten, at most ten or so.
pub fn log_ticks(low: f64, high: f64) -> Vec<f64> {
    let decades = (high / low).log10();
    let digits: &[f64] = if decades <= 3.0 { &[1.0, 2.0, 5.0] } else { &[1.0] };
    let every = (decades / 10.0).ceil().max(1.0) as i32;
    let [first, last] = [low, high].map(|end| end.log10().floor() as i32);
    let powers = (first..=last).filter(|power| power % every == 0);
    let all = powers.flat_map(|power| digits.iter().map(move |digit| digit * 10_f64.powi(power)));
    let (low, high) = (low * (1.0 - 1e-9), high * (1.0 + 1e-9));
    all.filter(|tick| (low..=high).contains(tick)).collect()
}

/// The texts of ticks, all with as many decimals as their step needs.
pub fn tick_texts(ticks: &[f64]) -> Vec<String> {
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

/// The text with typographic minus signs.
pub fn minus(text: &str) -> String {
    text.replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number::number;

    #[test]
    fn ticks_of_a_logarithmic_axis_are_1_2_and_5_or_powers_of_ten() {
        let texts = |low, high| log_ticks(low, high).into_iter().map(number).collect::<Vec<_>>();
        assert_eq!(texts(0.02, 0.13), ["0.02", "0.05", "0.1"]);
        assert_eq!(texts(0.7, 30.0), ["1", "2", "5", "10", "20"]);
        assert_eq!(texts(0.03, 300.0), ["0.1", "1", "10", "100"]);
        assert_eq!(log_ticks(1e-30, 1.0).len(), 11);
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(tick_texts(&ticks(0.0, 7.6, 8.0)), ["0", "1", "2", "3", "4", "5", "6", "7"]);
        assert_eq!(tick_texts(&ticks(-0.1, 0.1, 4.0)), ["−0.10", "−0.05", "0.00", "0.05", "0.10"]);
        assert_eq!(tick_texts(&ticks(0.0, 4e6, 2.0)), ["0.0e0", "2.0e6", "4.0e6"]);
        assert!(ticks(0.0, f64::INFINITY, 5.0).is_empty());
    }
}
