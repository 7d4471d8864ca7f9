//! Antialiased drawing into a raster image.

use image::RgbImage;
use image::imageops::thumbnail;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontTransform, RGBColor};

use crate::error::PlotError;
use crate::font::{FONT, register_font};

/// Everything is drawn this many times larger and then averaged: plotters draws hard edges.
const OVERSAMPLING: u32 = 2;

/// Colour of text and axes.
pub const INK: RGBColor = RGBColor(38, 38, 38);

/// The position of a text relative to its anchor point.
#[derive(Clone, Copy, Debug)]
pub enum Anchor {
    /// Begins at the point, vertically centred.
    Left,
    /// Ends at the point, vertically centred.
    Right,
    /// Centred below the point.
    Below,
    /// Begins at the point, above it.
    AboveLeft,
    /// Reads upwards, centred, its baseline at the point.
    Upwards,
}

/// A raster image being drawn. All lengths are pixels of the finished image, from its upper left
/// corner.
#[derive(Debug)]
pub struct Canvas {
    width: u32,
    height: u32,
    pixels: Vec<u8>,
}

impl Canvas {
    /// A white canvas of this size.
    ///
    /// # Errors
    /// If the font cannot be loaded.
    pub fn new(width: u32, height: u32) -> Result<Self, PlotError> {
        register_font()?;
        let size = (width * OVERSAMPLING) as usize * (height * OVERSAMPLING) as usize * 3;
        Ok(Self { width, height, pixels: vec![255; size] })
    }

    /// Draws a filled disc whose edge pixels are covered in part: for discs of few pixels.
    pub fn disc(&mut self, at: [f64; 2], radius: f64, colour: RGBColor) {
        let scale = f64::from(OVERSAMPLING);
        let ([x, y], radius) = (at.map(|k| k * scale), radius * scale);
        let [width, height] = [self.width, self.height].map(|side| (side * OVERSAMPLING) as usize);
        // Casts saturate: nothing is drawn outside.
        let span = |middle: f64, end: usize| {
            ((middle - radius - 1.0) as usize).min(end)
                ..((middle + radius + 1.0).ceil() as usize).min(end)
        };
        for row in span(y, height) {
            for column in span(x, width) {
                let distance = (column as f64 + 0.5 - x).hypot(row as f64 + 0.5 - y);
                let covered = (radius - distance + 0.5).clamp(0.0, 1.0);
                let pixel = 3 * (row * width + column);
                for (old, new) in
                    self.pixels[pixel..pixel + 3].iter_mut().zip([colour.0, colour.1, colour.2])
                {
                    *old = (f64::from(*old) * (1.0 - covered) + f64::from(new) * covered).round()
                        as u8;
                }
            }
        }
    }

    /// Draws with a pen.
    ///
    /// # Errors
    /// If plotters refuses.
    pub fn draw(
        &mut self,
        draw: impl FnOnce(&Pen<'_, '_>) -> Result<(), PenError>,
    ) -> Result<(), PlotError> {
        let size = (self.width * OVERSAMPLING, self.height * OVERSAMPLING);
        let area = BitMapBackend::with_buffer(&mut self.pixels, size).into_drawing_area();
        draw(&Pen { area: &area }).and_then(|()| area.present()).map_err(|error| PlotError::Draw {
            what: "the figure".to_owned(),
            reason: error.to_string(),
        })
    }

    /// The finished image.
    pub fn finish(self) -> RgbImage {
        let size = [self.width, self.height].map(|side| side * OVERSAMPLING);
        let large = RgbImage::from_raw(size[0], size[1], self.pixels)
            .expect("there are three bytes for every pixel");
        thumbnail(&large, self.width, self.height)
    }
}

type Area<'a> = DrawingArea<BitMapBackend<'a>, plotters::coord::Shift>;
/// An error of plotters while drawing on a [`Canvas`].
pub type PenError = DrawingAreaErrorKind<<BitMapBackend<'static> as DrawingBackend>::ErrorType>;

/// Draws on a [`Canvas`]. Points are `[x, y]` in pixels, y downwards.
pub struct Pen<'a, 'pixels> {
    area: &'a Area<'pixels>,
}

impl Pen<'_, '_> {
    fn scaled([x, y]: [f64; 2]) -> (i32, i32) {
        let scale = f64::from(OVERSAMPLING);
        ((x * scale).round() as i32, (y * scale).round() as i32)
    }

    /// A filled disc.
    ///
    /// # Errors
    /// If plotters refuses.
    pub fn disc(&self, at: [f64; 2], radius: f64, colour: RGBColor) -> Result<(), PenError> {
        let radius = (radius * f64::from(OVERSAMPLING)).round().max(1.0) as i32;
        self.area.draw(&Circle::new(Self::scaled(at), radius, colour.filled()))
    }

    /// A filled rectangle between two opposite corners.
    ///
    /// # Errors
    /// If plotters refuses.
    pub fn rectangle(&self, corners: [[f64; 2]; 2], colour: RGBColor) -> Result<(), PenError> {
        self.area.draw(&Rectangle::new(corners.map(Self::scaled), colour.filled()))
    }

    /// A filled polygon.
    ///
    /// # Errors
    /// If plotters refuses.
    pub fn polygon(&self, corners: &[[f64; 2]], colour: RGBColor) -> Result<(), PenError> {
        let corners: Vec<_> = corners.iter().map(|&corner| Self::scaled(corner)).collect();
        self.area.draw(&Polygon::new(corners, colour))
    }

    /// A line through the points.
    ///
    /// # Errors
    /// If plotters refuses.
    pub fn line(&self, path: &[[f64; 2]], width: f64, colour: RGBColor) -> Result<(), PenError> {
        let path: Vec<_> = path.iter().map(|&place| Self::scaled(place)).collect();
        let width = (width * f64::from(OVERSAMPLING)).round().max(1.0) as u32;
        self.area.draw(&PathElement::new(path, colour.stroke_width(width)))
    }

    /// A line of text of this height.
    ///
    /// # Errors
    /// If plotters refuses.
    pub fn text(
        &self,
        text: &str,
        at: [f64; 2],
        size: f64,
        anchor: Anchor,
    ) -> Result<(), PenError> {
        let pos = match anchor {
            Anchor::Left => Pos::new(HPos::Left, VPos::Center),
            Anchor::Right => Pos::new(HPos::Right, VPos::Center),
            Anchor::Below => Pos::new(HPos::Center, VPos::Top),
            Anchor::Upwards => Pos::new(HPos::Center, VPos::Bottom),
            Anchor::AboveLeft => Pos::new(HPos::Left, VPos::Bottom),
        };
        let mut font = font(size);
        if matches!(anchor, Anchor::Upwards) {
            font = font.transform(FontTransform::Rotate270);
        }
        let style = TextStyle::from(font).color(&INK).pos(pos);
        // The middle of a line of text is above the middle of its digits.
        let sunk = if matches!(pos.v_pos, VPos::Center) { 0.08 * size } else { 0.0 };
        self.area.draw(&Text::new(text.to_owned(), Self::scaled([at[0], at[1] + sunk]), style))
    }

    /// The width of a line of text of this height.
    pub fn text_width(&self, text: &str, size: f64) -> f64 {
        let width = self.area.estimate_text_size(text, &TextStyle::from(font(size)));
        width.map_or(0.0, |(width, _)| f64::from(width) / f64::from(OVERSAMPLING))
    }
}

fn font(size: f64) -> FontDesc<'static> {
    FontDesc::new(FontFamily::Name(FONT), size * f64::from(OVERSAMPLING), FontStyle::Normal)
}
