//! Animated GIFs.

use std::io::Write;

use gif::{DisposalMethod, Encoder, Frame, Repeat};

use crate::error::PlotError;

/// Encodes an endlessly repeated animation. Images are given as indices into one palette.
pub struct Gif<W: Write> {
    encoder: Encoder<W>,
    /// Hundredths of a second.
    delay: u16,
    size: (u16, u16),
    unchanged: Option<u8>,
    previous: Option<Vec<u8>>,
}

impl<W: Write> Gif<W> {
    /// Begins an animation of images of `size` (width, height) in at most 256 colours, each shown
    /// for `delay` hundredths of a second.
    ///
    /// # Errors
    /// If a side has more than 65535 pixels, or the file cannot be written.
    pub fn new(
        output: W,
        size: (u32, u32),
        palette: &[[u8; 3]],
        delay: u16,
    ) -> Result<Self, PlotError> {
        let side = |side: u32| u16::try_from(side).map_err(|_| PlotError::Size(side));
        let size = (side(size.0)?, side(size.1)?);
        let mut encoder = Encoder::new(output, size.0, size.1, palette.as_flattened())?;
        encoder.set_repeat(Repeat::Infinite)?;
        Ok(Self { encoder, delay, size, unchanged: None, previous: None })
    }

    /// Makes a colour of the palette transparent and writes it for every pixel that does not
    /// change, which compresses well where little moves.
    #[must_use]
    pub fn with_unchanged(self, index: u8) -> Self {
        Self { unchanged: Some(index), ..self }
    }

    /// Adds an image: one index a pixel, row after row. Only what differs from the image before is
    /// stored.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn push(&mut self, pixels: Vec<u8>) -> Result<(), PlotError> {
        let (width, height) = (usize::from(self.size.0), usize::from(self.size.1));
        let whole = [0, 0, width, height];
        let ([left, top, right, bottom], buffer) = match (&self.previous, self.unchanged) {
            (None, _) => (whole, pixels.clone()),
            (Some(previous), None) => {
                let part = changed(previous, &pixels, width);
                (part, cropped(&pixels, width, part))
            }
            (Some(previous), Some(unchanged)) => (whole, masked(previous, &pixels, unchanged)),
        };
        let frame = Frame {
            delay: self.delay,
            dispose: DisposalMethod::Keep,
            transparent: self.unchanged,
            left: left as u16,
            top: top as u16,
            width: (right - left) as u16,
            height: (bottom - top) as u16,
            buffer: buffer.into(),
            ..Frame::default()
        };
        self.encoder.write_frame(&frame)?;
        self.previous = Some(pixels);
        Ok(())
    }

    /// Shows the last image for `delay` hundredths of a second more.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn hold(&mut self, delay: u16) -> Result<(), PlotError> {
        if let Some(&corner) = self.previous.as_ref().and_then(|pixels| pixels.first()) {
            let still = Frame { delay, ..Frame::from_indexed_pixels(1, 1, [corner], None) };
            self.encoder.write_frame(&still)?;
        }
        Ok(())
    }

    /// Writes the end of the file.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(self) -> Result<(), PlotError> {
        Ok(self.encoder.into_inner()?.flush()?)
    }
}

/// The smallest rectangle (left, top, right, bottom) outside which two images agree; one pixel if
/// they agree everywhere, as a GIF has no empty images.
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

/// The pixels in a rectangle (left, top, right, bottom).
fn cropped(pixels: &[u8], width: usize, [left, top, right, bottom]: [usize; 4]) -> Vec<u8> {
    let mut part = Vec::with_capacity((right - left) * (bottom - top));
    for row in top..bottom {
        part.extend_from_slice(&pixels[row * width + left..row * width + right]);
    }
    part
}

/// The pixels, with `unchanged` where they agree with those before.
fn masked(before: &[u8], pixels: &[u8], unchanged: u8) -> Vec<u8> {
    let pairs = std::iter::zip(before, pixels);
    pairs.map(|(before, now)| if now == before { unchanged } else { *now }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_changes_is_written() {
        let before = [0; 12];
        let mut after = before;
        after[5] = 1;
        after[10] = 1;
        assert_eq!(changed(&before, &after, 4), [1, 1, 3, 3]);
        assert_eq!(changed(&before, &before, 4), [0, 0, 1, 1]);
        assert_eq!(cropped(&after, 4, [1, 1, 3, 3]), [1, 0, 0, 1]);
        assert_eq!(masked(&before, &after, 9)[4..8], [9, 1, 9, 9]);
    }
}
