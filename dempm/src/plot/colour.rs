//! From numbers to colours.

use plotters::style::RGBColor;
use plotters::style::colors::colormaps::{ColorMap, ViridisRGB};

use super::range::Range;

/// Colour of a value that is not a number.
pub(super) const UNKNOWN: RGBColor = RGBColor(150, 150, 150);

/// A colour scale: a map, the range it spans and whether that is of logarithms.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    pub range: Range,
    pub log: bool,
    pub signed: bool,
    /// The number of classes, if the values only name one: 0, 1, ...
    pub classes: Option<usize>,
}

impl Scale {
    /// The colour of a value.
    pub(super) fn colour(&self, value: f64) -> RGBColor {
        let value = if self.log { value.max(f64::MIN_POSITIVE).log10() } else { value };
        if value.is_finite() { self.at(self.range.fraction(value)) } else { UNKNOWN }
    }

    /// The colour at a place on the bar, from 0 to 1.
    pub(super) fn at(&self, fraction: f64) -> RGBColor {
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
