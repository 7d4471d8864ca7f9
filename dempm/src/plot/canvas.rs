//! A surface to draw on, smooth at the edges.

use image::RgbImage;
use image::imageops::thumbnail;
use miette::{IntoDiagnostic, miette};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontTransform, RGBColor, register_font};

/// Everything is drawn this many times larger and then averaged: plotters draws hard edges.
const OVERSAMPLING: u32 = 2;

const FONT: &str = "DejaVu Sans";
static FONT_FILE: &[u8] = include_bytes!("../../assets/DejaVuSans-subset.ttf");

/// Colour of text and axes.
pub(super) const INK: RGBColor = RGBColor(38, 38, 38);

/// How a text lies about its place.
#[derive(Clone, Copy)]
pub(super) enum Anchor {
    /// Begins at the place, vertically centred.
    Left,
    /// Ends at the place, vertically centred.
    Right,
    /// Centred below the place.
    Below,
    /// Begins at the place, above it.
    AboveLeft,
    /// Reads upwards, centred, its foot at the place.
    Upwards,
}

/// The pixels, while they are being drawn. All lengths are in pixels of the final picture.
pub(super) struct Canvas {
    width: u32,
    height: u32,
    pixels: Vec<u8>,
}

impl Canvas {
    /// A white canvas.
    pub(super) fn new(width: u32, height: u32) -> miette::Result<Self> {
        register_font(FONT, FontStyle::Normal, FONT_FILE)
            .map_err(|_| miette!("the built-in font is damaged"))?;
        let size = (width * OVERSAMPLING) as usize * (height * OVERSAMPLING) as usize * 3;
        Ok(Self { width, height, pixels: vec![255; size] })
    }

    /// Draws on it.
    pub(super) fn draw(
        &mut self,
        draw: impl FnOnce(&Pen<'_, '_>) -> Result<(), PenError>,
    ) -> miette::Result<()> {
        let size = (self.width * OVERSAMPLING, self.height * OVERSAMPLING);
        let area = BitMapBackend::with_buffer(&mut self.pixels, size).into_drawing_area();
        draw(&Pen { area: &area }).into_diagnostic()?;
        area.present().into_diagnostic()
    }

    /// The finished picture.
    pub(super) fn finish(self) -> miette::Result<RgbImage> {
        let large =
            RgbImage::from_raw(self.width * OVERSAMPLING, self.height * OVERSAMPLING, self.pixels)
                .ok_or_else(|| miette!("the picture has lost pixels"))?;
        Ok(thumbnail(&large, self.width, self.height))
    }
}

type Area<'a> = DrawingArea<BitMapBackend<'a>, plotters::coord::Shift>;
/// What plotters says when it cannot draw.
pub(super) type PenError =
    DrawingAreaErrorKind<<BitMapBackend<'static> as DrawingBackend>::ErrorType>;

/// Draws on a [`Canvas`].
pub(super) struct Pen<'a, 'pixels> {
    area: &'a Area<'pixels>,
}

impl Pen<'_, '_> {
    fn scaled([x, y]: [f64; 2]) -> (i32, i32) {
        let scale = f64::from(OVERSAMPLING);
        ((x * scale).round() as i32, (y * scale).round() as i32)
    }

    pub(super) fn disc(&self, at: [f64; 2], radius: f64, colour: RGBColor) -> Result<(), PenError> {
        let radius = (radius * f64::from(OVERSAMPLING)).round().max(1.0) as i32;
        self.area.draw(&Circle::new(Self::scaled(at), radius, colour.filled()))
    }

    pub(super) fn rectangle(
        &self,
        corners: [[f64; 2]; 2],
        colour: RGBColor,
    ) -> Result<(), PenError> {
        self.area.draw(&Rectangle::new(corners.map(Self::scaled), colour.filled()))
    }

    pub(super) fn polygon(&self, corners: &[[f64; 2]], colour: RGBColor) -> Result<(), PenError> {
        let corners: Vec<_> = corners.iter().map(|&corner| Self::scaled(corner)).collect();
        self.area.draw(&Polygon::new(corners, colour))
    }

    pub(super) fn line(
        &self,
        path: &[[f64; 2]],
        width: f64,
        colour: RGBColor,
    ) -> Result<(), PenError> {
        let path: Vec<_> = path.iter().map(|&place| Self::scaled(place)).collect();
        let width = (width * f64::from(OVERSAMPLING)).round().max(1.0) as u32;
        self.area.draw(&PathElement::new(path, colour.stroke_width(width)))
    }

    pub(super) fn text(
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

    /// The width of a text.
    pub(super) fn text_width(&self, text: &str, size: f64) -> f64 {
        let width = self.area.estimate_text_size(text, &TextStyle::from(font(size)));
        width.map_or(0.0, |(width, _)| f64::from(width) / f64::from(OVERSAMPLING))
    }
}

fn font(size: f64) -> FontDesc<'static> {
    FontDesc::new(FontFamily::Name(FONT), size * f64::from(OVERSAMPLING), FontStyle::Normal)
}
