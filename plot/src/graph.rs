//! A chart of lines as a part of a raster image.

use plotters::style::RGBColor;

use crate::canvas::{Anchor, INK, Pen, PenError};
use crate::ticks::{tick_texts, ticks};

const GRID: RGBColor = RGBColor(226, 226, 226);
const MARK: RGBColor = RGBColor(150, 150, 150);

/// A line of a [`Graph`]; interrupted where a number is not finite.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Its colour.
    pub colour: RGBColor,
    /// Points (x, y) in the units of the axes.
    pub points: Vec<(f64, f64)>,
}

/// A chart of lines with axes in a frame. The numbers of the axes and their titles are outside of it: 4.6 heights
/// of the text to the left and 3.2 below.
#[derive(Clone, Debug)]
pub struct Graph<'a> {
    /// Upper left and lower right corner of the frame, pixels.
    pub frame: [[f64; 2]; 2],
    /// Height of the text, pixels.
    pub font: f64,
    /// Quantity and unit along x.
    pub x: &'a str,
    /// Quantity and unit along y.
    pub y: &'a str,
    /// The lines.
    pub curves: &'a [Curve],
    /// Places along x with a vertical line.
    pub marks: &'a [f64],
    /// Whether the y axis begins at zero.
    pub from_zero: bool,
}

impl Graph<'_> {
    /// Draws it.
    ///
    /// # Errors
    /// If plotters refuses.
    pub fn draw(&self, pen: &Pen<'_, '_>) -> Result<(), PenError> {
        let [[left, top], [right, bottom]] = self.frame;
        let (font, thin) = (self.font, 0.06 * self.font);
        let points = || self.curves.iter().flat_map(|curve| curve.points.iter());
        let marks = self.marks.iter().copied();
        let x = range(points().map(|point| point.0).chain(marks), false);
        let y = range(points().map(|point| point.1), self.from_zero);
        let at = |point: &(f64, f64)| {
            let [along, up] = [(point.0 - x[0]) / (x[1] - x[0]), (point.1 - y[0]) / (y[1] - y[0])];
            [left + along * (right - left), bottom - up * (bottom - top)]
        };
        let size = 0.9 * font;
        let along_x = ticks(x[0], x[1], ((right - left) / (5.0 * font)).min(10.0));
        for (tick, text) in std::iter::zip(&along_x, tick_texts(&along_x)) {
            let [place, _] = at(&(*tick, y[0]));
            pen.line(&[[place, top], [place, bottom]], thin, GRID)?;
            pen.text(&text, [place, bottom + 0.4 * font], size, Anchor::Below)?;
        }
        let along_y = ticks(y[0], y[1], ((bottom - top) / (2.0 * font)).min(8.0));
        for (tick, text) in std::iter::zip(&along_y, tick_texts(&along_y)) {
            let [_, place] = at(&(x[0], *tick));
            pen.line(&[[left, place], [right, place]], thin, GRID)?;
            pen.text(&text, [left - 0.4 * font, place], size, Anchor::Right)?;
        }
        for &mark in self.marks {
            let [place, _] = at(&(mark, y[0]));
            pen.line(&[[place, top], [place, bottom]], 1.5 * thin, MARK)?;
        }
        for curve in self.curves {
            let finite = |point: &(f64, f64)| point.0.is_finite() && point.1.is_finite();
            let pieces = curve.points.split(|point| !finite(point));
            for piece in pieces.filter(|piece| !piece.is_empty()) {
                let path: Vec<[f64; 2]> = piece.iter().map(at).collect();
                pen.line(&path, 0.14 * font, curve.colour)?;
            }
        }
        let outline = [[left, top], [right, top], [right, bottom], [left, bottom], [left, top]];
        pen.line(&outline, thin, INK)?;
        let middle = [0.5 * (left + right), 0.5 * (top + bottom)];
        pen.text(self.x, [middle[0], bottom + 1.6 * font], font, Anchor::Below)?;
        pen.text(self.y, [left - 3.4 * font, middle[1]], font, Anchor::Upwards)
    }
}

/// The interval of the finite values, with some air above, and below if it does not begin at zero.
fn range(values: impl Iterator<Item = f64>, from_zero: bool) -> [f64; 2] {
    let finite = values.filter(|value| value.is_finite());
    let ends = finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
        [low.min(value), high.max(value)]
    });
    let [low, high] = if ends[0] <= ends[1] { ends } else { [0.0, 1.0] };
    let low = if from_zero { low.min(0.0) } else { low };
    let air = if high > low { 0.05 * (high - low) } else { 0.5 * high.abs().max(1.0) };
    [if low == 0.0 { 0.0 } else { low - air }, high + air]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Canvas;

    #[test]
    fn ranges_hold_the_values() {
        assert_eq!(range([2.0, f64::NAN, 4.0].into_iter(), false), [1.9, 4.1]);
        assert_eq!(range([2.0, 4.0].into_iter(), true), [0.0, 4.2]);
        assert_eq!(range([0.0, 1.0].into_iter(), false), [0.0, 1.05]);
        for values in [&[][..], &[0.0], &[-3.0, -3.0], &[f64::INFINITY]] {
            let [low, high] = range(values.iter().copied(), false);
            assert!(low < high, "{values:?}");
        }
    }

    /// A line at half of the height colours pixels there and nowhere else within the frame.
    #[test]
    fn a_line_is_where_its_numbers_are() {
        let red = RGBColor(255, 0, 0);
        let flat = Curve { colour: red, points: vec![(0.0, 1.0), (f64::NAN, 9.0), (2.0, 1.0)] };
        let line = Curve { colour: red, points: vec![(0.0, 0.5), (2.0, 0.5)] };
        let curves = [Curve { points: vec![(0.0, 1.0)], ..flat }, line];
        let mut canvas = Canvas::new(400, 300).unwrap();
        let graph = Graph {
            frame: [[80.0, 20.0], [380.0, 240.0]],
            font: 12.0,
            x: "x",
            y: "y",
            curves: &curves,
            marks: &[],
            from_zero: true,
        };
        canvas.draw(|pen| graph.draw(pen)).unwrap();
        let image = canvas.finish();
        let red = |y: u32| image.get_pixel(200, y).0[1] < 128 && image.get_pixel(200, y).0[0] > 200;
        // 0.5 of a range that ends at 1.05.
        let place = (240.0_f64 - 220.0 * 0.5 / 1.05).round() as u32;
        assert!((21..239).filter(|&y| red(y)).all(|y| y.abs_diff(place) <= 2));
        assert!(red(place));
    }
}
