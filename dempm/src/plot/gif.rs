//! Pictures of our own few colours as a GIF.

use std::collections::HashMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use gif::{DisposalMethod, Encoder, Frame, Repeat};
use image::RgbImage;
use miette::{IntoDiagnostic, miette};

use super::colour::Scale;

/// Colours of the map as they are; and how often each is mixed with white, for smooth edges.
const PURE: usize = 128;
const MIXED: usize = 32;
const SHARES: [f64; 3] = [0.75, 0.5, 0.25];
const GREYS: usize = 256 - PURE - MIXED * SHARES.len();

/// Writes a GIF that runs for ever.
pub(super) struct Gif {
    encoder: Encoder<BufWriter<File>>,
    palette: Palette,
    delay: u16,
    previous: Option<Vec<u8>>,
    size: (u16, u16),
}

impl Gif {
    pub(super) fn create(
        path: &Path,
        size: (u32, u32),
        fps: u32,
        scale: &Scale,
    ) -> miette::Result<Self> {
        let short = |size: u32| {
            u16::try_from(size).map_err(|_| miette!("{size} pixels are too many for a GIF"))
        };
        let size = (short(size.0)?, short(size.1)?);
        let palette = Palette::new(scale);
        let file = BufWriter::new(File::create(path).into_diagnostic()?);
        let bytes = palette.colours.as_flattened();
        let mut encoder = Encoder::new(file, size.0, size.1, bytes).into_diagnostic()?;
        encoder.set_repeat(Repeat::Infinite).into_diagnostic()?;
        // GIF counts in hundredths of a second.
        let delay = (100.0 / f64::from(fps)).round().max(2.0) as u16;
        Ok(Self { encoder, palette, delay, previous: None, size })
    }

    /// Adds a picture: of what differs from the one before it, the smallest rectangle.
    pub(super) fn push(&mut self, image: &RgbImage) -> miette::Result<()> {
        let pixels: Vec<u8> = image.pixels().map(|pixel| self.palette.nearest(pixel.0)).collect();
        let (width, height) = (usize::from(self.size.0), usize::from(self.size.1));
        let [left, top, right, bottom] = match &self.previous {
            Some(previous) => changed(previous, &pixels, width),
            None => [0, 0, width, height],
        };
        let mut part = Vec::with_capacity((right - left) * (bottom - top));
        for row in top..bottom {
            part.extend_from_slice(&pixels[row * width + left..row * width + right]);
        }
        let frame = Frame {
            delay: self.delay,
            dispose: DisposalMethod::Keep,
            left: left as u16,
            top: top as u16,
            width: (right - left) as u16,
            height: (bottom - top) as u16,
            buffer: part.into(),
            ..Frame::default()
        };
        self.encoder.write_frame(&frame).into_diagnostic()?;
        self.previous = Some(pixels);
        Ok(())
    }

    /// Shows the last picture for two seconds before the film begins anew, and closes the file.
    pub(super) fn finish(mut self) -> miette::Result<()> {
        if let Some(&corner) = self.previous.as_ref().and_then(|pixels| pixels.first()) {
            let still = Frame { delay: 200, ..Frame::from_indexed_pixels(1, 1, [corner], None) };
            self.encoder.write_frame(&still).into_diagnostic()?;
        }
        let mut file = self.encoder.into_inner().into_diagnostic()?;
        std::io::Write::flush(&mut file).into_diagnostic()
    }
}

/// The smallest rectangle (left, top, right, bottom) outside which two pictures agree; one pixel
/// if they agree everywhere, as a GIF has no empty pictures.
fn changed(before: &[u8], after: &[u8], width: usize) -> [usize; 4] {
    let mut bounds = [usize::MAX, usize::MAX, 0, 0];
    for (row, (old, new)) in std::iter::zip(before.chunks(width), after.chunks(width)).enumerate() {
        let differs = |(a, b): (&u8, &u8)| a != b;
        if let Some(first) = std::iter::zip(old, new).position(differs) {
            let last = std::iter::zip(old, new).rposition(differs).unwrap_or(first);
            bounds[0] = bounds[0].min(first);
            bounds[1] = bounds[1].min(row);
            bounds[2] = bounds[2].max(last + 1);
            bounds[3] = row + 1;
        }
    }
    if bounds[2] == 0 { [0, 0, 1, 1] } else { bounds }
}

/// The 256 colours of the film. The pictures consist of the colour map, greys and mixtures of the
/// map with white, so a palette made for them needs no dithering and does not flicker.
struct Palette {
    colours: Vec<[u8; 3]>,
    known: HashMap<[u8; 3], u8>,
}

impl Palette {
    fn new(scale: &Scale) -> Self {
        let map = |index: usize, of: usize| {
            let colour = scale.at(index as f64 / (of - 1) as f64);
            [colour.0, colour.1, colour.2]
        };
        let mut colours: Vec<[u8; 3]> = (0..PURE).map(|index| map(index, PURE)).collect();
        for share in SHARES {
            let mix = |c: u8| (share * f64::from(c) + (1.0 - share) * 255.0).round() as u8;
            colours.extend((0..MIXED).map(|index| map(index, MIXED).map(mix)));
        }
        colours.extend((0..GREYS).map(|index| [(index * 255 / (GREYS - 1)) as u8; 3]));
        Self { colours, known: HashMap::new() }
    }

    fn nearest(&mut self, colour: [u8; 3]) -> u8 {
        *self.known.entry(colour).or_insert_with(|| {
            let distance = |other: &[u8; 3]| -> i32 {
                std::iter::zip(colour, other)
                    .map(|(a, &b)| (i32::from(a) - i32::from(b)).pow(2))
                    .sum()
            };
            let nearest = (0..self.colours.len()).min_by_key(|&i| distance(&self.colours[i]));
            nearest.unwrap_or_default() as u8
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::range::Range;

    #[test]
    fn only_what_changes_is_written() {
        let before = [0; 12];
        let mut after = before;
        after[5] = 1;
        after[10] = 1;
        assert_eq!(changed(&before, &after, 4), [1, 1, 3, 3]);
        assert_eq!(changed(&before, &before, 4), [0, 0, 1, 1]);
    }

    #[test]
    fn the_palette_has_what_the_pictures_have() {
        let range = Range { low: 0.0, high: 1.0, cut: [false; 2] };
        let scale = Scale { range, log: false, signed: false, classes: None };
        let mut palette = Palette::new(&scale);
        assert_eq!(palette.colours.len(), 256);
        for colour in [[255; 3], [0; 3], [68, 1, 84]] {
            let found = palette.nearest(colour);
            assert_eq!(palette.colours[usize::from(found)], colour);
        }
    }
}
