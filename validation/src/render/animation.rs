//! Animations as GIF.

use plot::{Gif, PlotError};

use crate::render::figure::Picture;
use crate::render::overlay::{Image, PALETTE};

/// Time that a picture is shown, hundredths of a second.
const DELAY: u16 = 10;
/// Index of the transparent colour, which follows those of the palette.
const UNCHANGED: u8 = PALETTE.len() as u8;

/// Pictures of the same size as an endless animation.
///
/// # Errors
/// If they cannot be encoded.
pub fn animated(images: &[Image]) -> Result<Picture, PlotError> {
    let mut bytes = Vec::new();
    let size = images.first().map_or((1, 1), |image| (image.width, image.height));
    let colours = [PALETTE.as_slice(), &[[0; 3]]].concat();
    let mut gif = Gif::new(&mut bytes, size, &colours, DELAY)?.with_unchanged(UNCHANGED);
    for image in images {
        gif.push(image.pixels.clone())?;
    }
    gif.finish()?;
    Ok(Picture::Gif(bytes))
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
