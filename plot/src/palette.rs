//! The 256 colours of an animation.

use std::collections::HashMap;

use image::RgbImage;
use plotters::style::RGBColor;

use crate::colour_scale::ColourScale;

/// Colours of the map itself, and of others with their mixtures.
const PURE: usize = 128;
/// Colours of the map that are also mixed with white, for antialiased edges, in these shares.
const MIXED: usize = 32;
const SHARES: [f64; 3] = [0.75, 0.5, 0.25];
const GREYS: usize = 256 - PURE - MIXED * SHARES.len();

/// Most other colours.
const MOST_OTHERS: usize = 16;

/// A palette for figures that consist of a colour scale, greys, some other colours and mixtures with white.
/// It needs no dithering, and the same for all frames, it does not flicker.
#[derive(Clone, Debug)]
pub struct Palette {
    colours: Vec<[u8; 3]>,
    known: HashMap<[u8; 3], u8>,
}

impl Palette {
    /// The palette of figures with this colour scale and up to 16 `others`.
    pub fn new(scale: &ColourScale, others: &[RGBColor]) -> Self {
        let others = &others[..others.len().min(MOST_OTHERS)];
        let pure = PURE - others.len() * (1 + SHARES.len());
        let map = |index: usize, of: usize| {
            let colour = scale.at(index as f64 / (of - 1) as f64);
            [colour.0, colour.1, colour.2]
        };
        let mut colours: Vec<[u8; 3]> = (0..pure).map(|index| map(index, pure)).collect();
        colours.extend(others.iter().map(|colour| [colour.0, colour.1, colour.2]));
        for share in SHARES {
            let mix = |c: u8| (share * f64::from(c) + (1.0 - share) * 255.0).round() as u8;
            colours.extend((0..MIXED).map(|index| map(index, MIXED).map(mix)));
            colours.extend(others.iter().map(|other| [other.0, other.1, other.2].map(mix)));
        }
        colours.extend((0..GREYS).map(|index| [(index * 255 / (GREYS - 1)) as u8; 3]));
        Self { colours, known: HashMap::new() }
    }

    /// The colours, red, green and blue.
    pub fn colours(&self) -> &[[u8; 3]] {
        &self.colours
    }

    /// The image in colours of the palette: one index a pixel, row after row.
    pub fn indexed(&mut self, image: &RgbImage) -> Vec<u8> {
        image.pixels().map(|pixel| self.nearest(pixel.0)).collect()
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
    use crate::colour_scale::Range;

    #[test]
    fn the_palette_has_the_colours_of_the_figures() {
        let range = Range { low: 0.0, high: 1.0, cut: [false; 2] };
        let scale = ColourScale { range, log: false, signed: false, classes: None };
        let mut palette = Palette::new(&scale, &[RGBColor(200, 10, 90)]);
        assert_eq!(palette.colours.len(), 256);
        for colour in [[255; 3], [0; 3], [68, 1, 84], [200, 10, 90], [228, 133, 173]] {
            let found = palette.nearest(colour);
            assert_eq!(palette.colours[usize::from(found)], colour);
        }
    }
}
