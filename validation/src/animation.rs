//! Snapshots one after the other, as a GIF.

use gif::{Encoder, Frame as GifFrame, Repeat};
use image::{Rgb, RgbImage};
use miette::IntoDiagnostic;

use crate::figure::Picture;

/// Hundredths of a second that a picture is shown.
const DELAY: u16 = 6;

/// Pictures of the same size as an animation, each with a palette of its own: snapshots of
/// [`crate::picture`] have few colours.
///
/// # Errors
/// If they cannot be encoded.
pub fn animated(images: &[RgbImage]) -> miette::Result<Picture> {
    let mut bytes = Vec::new();
    let (width, height) = images.first().map_or((1, 1), |image| (image.width(), image.height()));
    {
        let (width, height) = (width as u16, height as u16);
        let mut encoder = Encoder::new(&mut bytes, width, height, &[]).into_diagnostic()?;
        encoder.set_repeat(Repeat::Infinite).into_diagnostic()?;
        for image in images {
            let (palette, pixels) = indexed(image);
            let mut frame = GifFrame::from_palette_pixels(width, height, pixels, palette, None);
            frame.delay = DELAY;
            encoder.write_frame(&frame).into_diagnostic()?;
        }
    }
    Ok(Picture::Gif(bytes))
}

/// A picture's colours and where they are; beyond 256 the nearest of those so far is taken.
fn indexed(image: &RgbImage) -> (Vec<u8>, Vec<u8>) {
    let mut palette: Vec<Rgb<u8>> = Vec::new();
    let mut pixels = Vec::with_capacity(image.len() / 3);
    // Neighbouring pixels mostly agree.
    let mut last = (Rgb([0; 3]), None);
    for &pixel in image.pixels() {
        let index = match last {
            (colour, Some(index)) if colour == pixel => index,
            _ => palette.iter().position(|colour| *colour == pixel).unwrap_or_else(|| {
                if palette.len() < 256 {
                    palette.push(pixel);
                    palette.len() - 1
                } else {
                    nearest(&palette, pixel)
                }
            }),
        };
        last = (pixel, Some(index));
        pixels.push(index as u8);
    }
    (palette.iter().flat_map(|colour| colour.0).collect(), pixels)
}

fn nearest(palette: &[Rgb<u8>], pixel: Rgb<u8>) -> usize {
    let distance = |colour: &Rgb<u8>| -> i32 {
        (0..3).map(|k| (i32::from(colour.0[k]) - i32::from(pixel.0[k])).pow(2)).sum()
    };
    let places = 0..palette.len();
    places.min_by_key(|&place| distance(&palette[place])).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_animation_keeps_its_pictures() {
        let red = RgbImage::from_pixel(4, 3, Rgb([200, 0, 0]));
        let grey = RgbImage::from_pixel(4, 3, Rgb([90, 90, 90]));
        let Picture::Gif(bytes) = animated(&[red.clone(), grey]).unwrap() else { panic!() };
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(&bytes[..]).unwrap();
        let first = decoder.read_next_frame().unwrap().unwrap().buffer.to_vec();
        assert_eq!(first[..4], [200, 0, 0, 255]);
        let second = decoder.read_next_frame().unwrap().unwrap().buffer.to_vec();
        assert_eq!(second[..4], [90, 90, 90, 255]);
        assert!(decoder.read_next_frame().unwrap().is_none());
    }
}
