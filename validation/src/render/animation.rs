//! Animations as GIF.

use gif::{DisposalMethod, Encoder, Frame, Repeat};
use miette::IntoDiagnostic;

use crate::render::figure::Picture;
use crate::render::overlay::{Image, PALETTE};

/// Time that a picture is shown, hundredths of a second.
const DELAY: u16 = 10;
/// Index of the transparent colour: the pixel is that of the picture before.
const UNCHANGED: u8 = PALETTE.len() as u8;

/// Pictures of the same size as an endless animation. After the first, each picture holds only the
/// pixels that changed, so that material at rest takes no space.
///
/// # Errors
/// If they cannot be encoded.
pub fn animated(images: &[Image]) -> miette::Result<Picture> {
    let mut bytes = Vec::new();
    let (width, height) = images.first().map_or((1, 1), |image| (image.width, image.height));
    {
        let (width, height) = (width as u16, height as u16);
        let colours = [PALETTE.as_flattened(), &[0; 3]].concat();
        let mut encoder = Encoder::new(&mut bytes, width, height, &colours).into_diagnostic()?;
        encoder.set_repeat(Repeat::Infinite).into_diagnostic()?;
        let mut before: Option<&Image> = None;
        for image in images {
            let pixels = match before {
                Some(before) => changed(image, before),
                None => image.pixels.clone(),
            };
            let frame = Frame {
                delay: DELAY,
                dispose: DisposalMethod::Keep,
                transparent: Some(UNCHANGED),
                width,
                height,
                buffer: pixels.into(),
                ..Frame::default()
            };
            encoder.write_frame(&frame).into_diagnostic()?;
            before = Some(image);
        }
    }
    Ok(Picture::Gif(bytes))
}

fn changed(image: &Image, before: &Image) -> Vec<u8> {
    let pairs = image.pixels.iter().zip(&before.pixels);
    pairs.map(|(now, before)| if now == before { UNCHANGED } else { *now }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_animation_keeps_its_pictures() {
        let image = |pixels: [u8; 4]| Image { width: 2, height: 2, pixels: pixels.to_vec() };
        let Picture::Gif(bytes) = animated(&[image([0, 1, 2, 3]), image([0, 12, 2, 4])]).unwrap()
        else {
            panic!("not a GIF")
        };
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(&bytes[..]).unwrap();
        let opaque = |place: usize| [&PALETTE[place][..], &[255]].concat();
        let first = decoder.read_next_frame().unwrap().unwrap().buffer.to_vec();
        assert_eq!(first, [0, 1, 2, 3].map(opaque).concat());
        let second = decoder.read_next_frame().unwrap().unwrap().buffer.to_vec();
        // The second and the fourth pixel have changed; the others are transparent.
        assert_eq!([second[3], second[11]], [0, 0]);
        assert_eq!([&second[4..8], &second[12..]], [opaque(12), opaque(4)]);
        assert!(decoder.read_next_frame().unwrap().is_none());
    }
}
