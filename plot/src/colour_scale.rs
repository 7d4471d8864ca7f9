//! Colour scales of scalar fields.

use plotters::style::RGBColor;
use plotters::style::colors::colormaps::{ColorMap, ViridisRGB};

/// A map from values to colours: viridis, or diverging from blue to red if `signed`.
#[derive(Clone, Copy, Debug)]
pub struct ColourScale {
    /// The values at the ends of the map; their decimal logarithms if `log`.
    pub range: Range,
    /// Colours follow the decimal logarithm of the value.
    pub log: bool,
    /// The middle of a diverging map is the middle of the range.
    pub signed: bool,
    /// The number of classes, for values that are class numbers 0, 1, ...
    pub classes: Option<usize>,
}

/// The interval of values that a colour scale spans.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Whether values lie below `low`, and above `high`.
    pub cut: [bool; 2],
}

/// Share of the values that is cut off at either end.
const TAIL: f64 = 0.01;

impl Range {
    /// From the 1st to the 99th percentile of the finite `values`, so that a few outliers do not
    /// take all colours. Symmetric about zero if `signed`; begins at zero if that is near.
    pub fn robust(values: impl Iterator<Item = f64>, signed: bool) -> Self {
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
            let half = 0.05 * high.abs();
            (low, high) = match (high == 0.0, signed) {
                (false, _) => (low - half, high + half),
                (true, true) => (-0.5, 0.5),
                (true, false) => (0.0, 1.0),
            };
        }
        Self { low, high, cut: [least < low, most > high] }
    }

    /// As [`robust`](Self::robust), for the decimal logarithms of the positive values.
    pub fn robust_log(values: impl Iterator<Item = f64>) -> Self {
        let logarithms: Vec<f64> = values.filter(|&v| v > 0.0).map(f64::log10).collect();
        let mut range = Self::robust(logarithms.iter().copied(), false);
        if range.low == 0.0 && range.high > 0.0 {
            // Zero is an ordinary logarithm.
            let least = logarithms.iter().copied().fold(f64::INFINITY, f64::min);
            range.low = least.min(range.high - 1.0);
        }
        range
    }

    /// The position of `value` between `low` (0) and `high` (1), clamped.
    pub fn fraction(&self, value: f64) -> f64 {
        ((value - self.low) / (self.high - self.low)).clamp(0.0, 1.0)
    }
}

impl ColourScale {
    /// Colour of values that are not finite: grey.
    pub const UNKNOWN: RGBColor = RGBColor(150, 150, 150);

    /// The colour of a value.
    pub fn colour(&self, value: f64) -> RGBColor {
        let value = if self.log { value.max(f64::MIN_POSITIVE).log10() } else { value };
        if value.is_finite() { self.at(self.range.fraction(value)) } else { Self::UNKNOWN }
    }

    /// The colour at a position on the colour bar, from 0 to 1.
    pub fn at(&self, fraction: f64) -> RGBColor {
        let fraction = match self.classes {
            Some(classes) if classes > 1 => {
                let last = (classes - 1) as f64;
                (fraction * classes as f64).floor().min(last) / last
            }
            _ => fraction,
        };
        if self.signed { blue_to_red(fraction) } else { ViridisRGB.get_color(fraction as f32) }
    }
}

/// Diverging colours through light grey (K. Moreland, "Diverging color maps for scientific
/// visualization", 2009), whose lightness is symmetric about the middle.
fn blue_to_red(fraction: f64) -> RGBColor {
    const STOPS: [[f64; 3]; 9] = [
        [59.0, 76.0, 192.0],
        [98.0, 130.0, 234.0],
        [141.0, 176.0, 254.0],
        [184.0, 208.0, 249.0],
        [221.0, 221.0, 221.0],
        [245.0, 196.0, 173.0],
        [244.0, 154.0, 123.0],
        [222.0, 96.0, 77.0],
        [180.0, 4.0, 38.0],
    ];
    let place = fraction.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let left = (place as usize).min(STOPS.len() - 2);
    let part = place - left as f64;
    let mix =
        |c: usize| (STOPS[left][c] + part * (STOPS[left + 1][c] - STOPS[left][c])).round() as u8;
    RGBColor(mix(0), mix(1), mix(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ticks::ticks;

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
    fn distances_of_zero_are_at_the_lower_end() {
        let range = Range::robust([0.0, 0.0].into_iter(), false);
        assert_eq!((range.low, range.high), (0.0, 1.0));
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
}
