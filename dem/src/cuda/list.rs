//! A Verlet list as the two-sided lists of the GPU.

use crate::contact::ContactLaw;
use crate::neighbours::{Image2, Neighbours};
use crate::packing::{Disc, Pair};
use crate::real::{Image, Real};

/// One neighbour of a disc, as in `rve.cu`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Entry<R> {
    pub neighbour: u16,
    /// Row of the neighbour's list that has the same pair.
    pub partner: u16,
    /// [`image_code`], 0 where all neighbours are nearest images.
    pub image: u16,
    /// Tangential force, zero where the neighbour owns the pair.
    pub tangential: R,
}

impl<R: Real> Entry<R> {
    /// `partner` above the ten bits of `neighbour`.
    pub fn packed(&self) -> u16 {
        self.neighbour | self.partner << 10
    }

    pub fn unpack(packed: u16, image: u16, tangential: R) -> Self {
        Self { neighbour: packed & 1023, partner: packed >> 10, image, tangential }
    }
}

/// The neighbours of every disc, seen from both sides of each pair, in the order of the GPU's lists.
pub(super) fn two_sided<R: Real>(list: &Neighbours<R>, discs: usize) -> Vec<Vec<Entry<R>>> {
    let mut sides = vec![Vec::new(); discs];
    for (index, pair) in list.pairs.iter().enumerate() {
        let (there, back) = list
            .images
            .get(index)
            .map_or((0, 0), |&image| (image_code(image), image_code(image.map(reversed))));
        for (i, j, image) in [(pair.i, pair.j, there), (pair.j, pair.i, back)] {
            let tangential = if owns(i, j, image) { pair.tangential } else { R::default() };
            let partner = 0;
            sides[i as usize].push(Entry { neighbour: j, partner, image, tangential });
        }
    }
    for side in &mut sides {
        side.sort_unstable_by_key(|e| (e.neighbour, e.image));
    }
    for i in 0..discs {
        for row in 0..sides[i].len() {
            let Entry { neighbour, image, .. } = sides[i][row];
            let back = if list.images.is_empty() {
                0
            } else {
                image_code(from_image_code(image).map(reversed))
            };
            let partner = sides[neighbour as usize]
                .iter()
                .position(|e| (e.neighbour as usize, e.image) == (i, back))
                .expect("pairs are listed from both sides");
            sides[i][row].partner = partner as u16;
        }
    }
    sides
}

/// The pairs of two-sided lists, each once, in the order of [`Neighbours`]. `images` tells whether
/// the lists hold other images than the nearest.
pub(super) fn one_sided<R: Real>(
    sides: &[Vec<Entry<R>>],
    images: bool,
    discs: &[Disc<R>],
    law: &ContactLaw<R>,
) -> (Vec<Pair<R>>, Vec<Image2>) {
    let mut pairs = Vec::new();
    let mut pair_images = Vec::new();
    for (i, side) in sides.iter().enumerate() {
        for entry in side {
            let j = entry.neighbour as usize;
            if j < i || (j == i && !owns(i as u16, entry.neighbour, entry.image)) {
                continue;
            }
            let owner = if owns(i as u16, entry.neighbour, entry.image) {
                entry
            } else {
                &sides[j][entry.partner as usize]
            };
            pairs.push(Pair {
                i: i as u16,
                j: entry.neighbour,
                tangential: owner.tangential,
                dashpot: law.dashpot(&discs[i], &discs[j]),
            });
            if images {
                pair_images.push(from_image_code(entry.image));
            }
        }
    }
    (pairs, pair_images)
}

/// Which disc of a pair evaluates it, as in `rve.cu`.
fn owns(i: u16, j: u16, image: u16) -> bool {
    const ZERO_IMAGE: u16 = 64 << 7 | 64;
    if i == j { image > ZERO_IMAGE } else { (i < j) == ((i ^ j) & 1 == 0) }
}

/// The image of `i` seen from `j`, if `image` is that of `j` seen from `i`: minus the separation.
/// In `[0, 1)` the reading of minus a fraction is one less the reading of the fraction.
fn reversed(image: Image) -> Image {
    Image { shift: -image.shift - i16::from(image.unsigned), unsigned: image.unsigned }
}

/// Seven bits for each cell vector: `shift + 32`, then whether the reading is unsigned.
pub(super) fn image_code([x, y]: Image2) -> u16 {
    let code = |image: Image| ((image.shift + 32) as u16) << 1 | u16::from(image.unsigned);
    code(y) << 7 | code(x)
}

fn from_image_code(code: u16) -> Image2 {
    [code & 127, code >> 7]
        .map(|code| Image { shift: (code >> 1) as i16 - 32, unsigned: code & 1 != 0 })
}

/// Whether [`image_code`] can express the image.
pub(super) fn fits_code(image: Image2) -> bool {
    image.iter().all(|i| (-31..31).contains(&i.shift))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Seen from the other side, a separation changes its sign.
        #[test]
        fn reversed_image(a in 0.0..1.0f64, b in 0.0..1.0f64, k in -5..5i32) {
            let (a, b) = (f32::fraction(a), f32::fraction(b));
            let nearest = f32::nearest(a, b).to_f64() * f32::UNIT;
            let image = Image::of(nearest, nearest + f64::from(k));
            prop_assert_eq!(f32::image(a, b, image), -f32::image(b, a, reversed(image)));
        }

        #[test]
        fn image_code_is_reversible(x in -31..31i16, y in -31..31i16, ux: bool, uy: bool) {
            let image = [Image { shift: x, unsigned: ux }, Image { shift: y, unsigned: uy }];
            prop_assert!(fits_code(image));
            prop_assert_eq!(from_image_code(image_code(image)), image);
        }
    }
}
