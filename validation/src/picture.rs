//! Snapshots of a prediction over the truth, as the paper's Fig. 10: the truth in grey, predicted
//! points coloured by the square of their distance from where they should be.

use dempm::trajectory::Frame;
use image::{ImageFormat, Rgb, RgbImage};
use miette::IntoDiagnostic;

use crate::figure::Picture;

/// What is drawn and how large.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Part of the plane that is shown, from the origin on, m.
    pub size: [f64; 2],
    /// Diameter of a point, m.
    pub spacing: f64,
    /// Width of the domain, m: the unit of errors.
    pub box_width: f64,
    /// Width of the picture, pixels.
    pub width: u32,
}

const PAPER: Rgb<u8> = Rgb([255, 255, 255]);
const TRUTH: Rgb<u8> = Rgb([205, 205, 200]);
const SOLID: Rgb<u8> = Rgb([120, 120, 116]);
/// Squared distances, box width 1, at the two ends of the colours.
pub const RANGE: [f64; 2] = [1e-8, 1e-3];

impl View {
    /// The part of the domain that frames touch.
    pub fn of<'a>(
        frames: impl IntoIterator<Item = &'a Frame>,
        spacing: f64,
        domain: [f64; 2],
    ) -> Self {
        let mut size = [spacing; 2];
        for x in frames.into_iter().flat_map(|frame| &frame.position) {
            for k in 0..2 {
                size[k] = size[k].max(x[k]);
            }
        }
        let size = [0, 1].map(|k| (size[k] + 2.0 * spacing).min(domain[k]));
        Self { size, spacing, box_width: domain[0], width: 720 }
    }

    fn scale(&self) -> f64 {
        f64::from(self.width) / self.size[0]
    }

    fn height(&self) -> u32 {
        (self.size[1] * self.scale()).ceil() as u32
    }

    /// One prediction over the truth.
    pub fn draw(&self, predicted: &[[f64; 2]], truth: &Frame) -> RgbImage {
        let mut image = RgbImage::from_pixel(self.width, self.height() + 2, PAPER);
        for [x0, y0, x1, y1] in &truth.boxes {
            self.rectangle(&mut image, [*x0, *y0], [*x1, *y1]);
        }
        for x in &truth.position {
            self.disc(&mut image, *x, 1.0, TRUTH);
        }
        for (p, t) in predicted.iter().zip(&truth.position) {
            let square = ((p[0] - t[0]).powi(2) + (p[1] - t[1]).powi(2)) / self.box_width.powi(2);
            self.disc(&mut image, *p, 0.62, colour(square));
        }
        // The floor.
        for x in 0..self.width {
            for y in self.height()..self.height() + 2 {
                image.put_pixel(x, y, SOLID);
            }
        }
        image
    }

    fn pixel(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [x * self.scale(), f64::from(self.height()) - y * self.scale()]
    }

    fn disc(&self, image: &mut RgbImage, place: [f64; 2], part: f64, colour: Rgb<u8>) {
        let [x, y] = self.pixel(place);
        let radius = (0.5 * part * self.spacing * self.scale()).max(0.8);
        let whole = |from: f64| {
            (from.floor().max(0.0) as u32, (from + 2.0 * radius).ceil().max(0.0) as u32)
        };
        let (columns, rows) = (whole(x - radius), whole(y - radius));
        for row in rows.0..=rows.1.min(self.height().saturating_sub(1)) {
            for column in columns.0..=columns.1.min(self.width - 1) {
                let from = [f64::from(column) + 0.5 - x, f64::from(row) + 0.5 - y];
                if from[0].hypot(from[1]) <= radius {
                    image.put_pixel(column, row, colour);
                }
            }
        }
    }

    fn rectangle(&self, image: &mut RgbImage, low: [f64; 2], high: [f64; 2]) {
        let ([left, bottom], [right, top]) = (self.pixel(low), self.pixel(high));
        // Casting saturates and turns what is absent (NaN) into nothing.
        for row in top as u32..(bottom as u32).min(self.height()) {
            for column in left as u32..(right as u32).min(self.width) {
                image.put_pixel(column, row, SOLID);
            }
        }
    }
}

/// Pictures below each other.
///
/// # Errors
/// If they cannot be encoded.
pub fn stacked(images: &[RgbImage]) -> miette::Result<Picture> {
    const GAP: u32 = 14;
    let width = images.iter().map(RgbImage::width).max().unwrap_or(1);
    let height: u32 = images.iter().map(|image| image.height() + GAP).sum();
    let mut whole = RgbImage::from_pixel(width, height.max(1), PAPER);
    let mut top = 0;
    for image in images {
        image::imageops::replace(&mut whole, image, 0, i64::from(top));
        top += image.height() + GAP;
    }
    let mut bytes = std::io::Cursor::new(Vec::new());
    whole.write_to(&mut bytes, ImageFormat::Png).into_diagnostic()?;
    Ok(Picture::Png(bytes.into_inner()))
}

/// From blue over yellow to red, by the logarithm of the squared distance.
pub fn colour(square: f64) -> Rgb<u8> {
    const STOPS: [[f64; 3]; 4] =
        [[49.0, 86.0, 165.0], [86.0, 170.0, 190.0], [245.0, 200.0, 70.0], [190.0, 30.0, 45.0]];
    let [low, high] = RANGE.map(f64::ln);
    let place = ((square.max(RANGE[0]).ln() - low) / (high - low)).clamp(0.0, 1.0) * 3.0;
    let stop = (place as usize).min(2);
    let part = place - stop as f64;
    let mixed = |k: usize| STOPS[stop][k] + part * (STOPS[stop + 1][k] - STOPS[stop][k]);
    Rgb([0, 1, 2].map(|k| mixed(k).round() as u8))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_right_prediction_is_blue_over_grey_and_a_wrong_one_red() {
        let truth = Frame { position: vec![[0.5, 0.5], [1.5, 0.5]], ..Frame::default() };
        let view = View { size: [3.0, 1.0], spacing: 1.0, box_width: 1.0, width: 300 };
        let image = view.draw(&[[0.5, 0.5], [2.5, 0.5]], &truth);
        assert_eq!(*image.get_pixel(50, 50), colour(0.0));
        assert_eq!(*image.get_pixel(150, 50), TRUTH);
        assert_eq!(*image.get_pixel(250, 50), colour(1.0));
        assert_eq!(*image.get_pixel(200, 5), PAPER);
    }
}
