//! A Verlet list as the slots of the GPU, described in `rve.cu` and `shared.cuh`.

use std::cmp::Reverse;

use super::abi::{Rows, Vector};
use super::error::RveFailure;
use super::real::CudaReal;
use super::shape::{Shape, WARP};
use crate::contact::ContactLaw;
use crate::disc::Disc;
use crate::neighbours::{Image2, Neighbours, Pair};
use crate::real::{Image, Real};

/// The list of one RVE in the arrays of [`Batch`](super::abi::Batch).
pub(super) struct SlotList<'a, R: CudaReal> {
    /// Disc of each seat.
    pub seated: &'a mut [u16],
    pub rows: &'a mut [Rows],
    pub neighbour: &'a mut [u32],
    pub pair: &'a mut [Vector<R>],
    pub tangential: &'a mut [R],
    /// Rolling springs; empty without rolling resistance.
    pub rolling: &'a mut [R],
    pub incoming: &'a mut [u16],
}

/// A pair as one of its discs sees it.
#[derive(Clone, Copy)]
struct Side {
    neighbour: u16,
    /// [`image_code`], 0 where all neighbours are nearest images.
    image: u16,
    /// Index in the CPU's list.
    pair: usize,
}

/// Pairs that a disc owns, and pairs that it does not; each in ascending order of neighbour and image.
#[derive(Clone, Default)]
struct Sides([Vec<Side>; 2]);

impl Sides {
    fn rows(&self, kind: usize) -> usize {
        self.0[kind].len()
    }

    /// Sort key of seats, as in `take_seat` of `list.cuh`.
    fn class(&self) -> usize {
        let owned = self.rows(0);
        let other = (owned + self.rows(1)).saturating_sub(3).min(4);
        5 * owned.min(5) + if owned.is_multiple_of(2) { other } else { 4 - other }
    }
}

impl<R: CudaReal> SlotList<'_, R> {
    /// Lays out a list and returns how many slots it takes, of pairs at their owners and of the
    /// same at the other discs.
    ///
    /// # Errors
    /// The list does not fit.
    pub fn put(
        &mut self,
        list: &Neighbours<R>,
        discs: &[Disc<R>],
        shape: &Shape,
    ) -> Result<[u32; 2], RveFailure> {
        let full = RveFailure::ListFull { rows: shape.rows };
        if !list.images.iter().all(|&image| fits_code(image)) {
            return Err(full);
        }
        let sides = sides(list, discs);
        if sides.iter().any(|s| s.rows(0) + s.rows(1) > shape.rows) {
            return Err(full);
        }

        // Discs by seat, and threads without one.
        let mut order: Vec<usize> = (0..discs.len()).collect();
        order.sort_by_key(|&i| Reverse(sides[i].class()));
        order.extend(discs.len()..shape.threads);
        let mut seat_of = vec![0; shape.threads];
        for (seat, &i) in order.iter().enumerate() {
            self.seated[seat] = i as u16;
            seat_of[i] = seat as u16;
        }
        order.truncate(discs.len());
        let mut used = [0; 2];
        for (kind, room) in [shape.slots, shape.incoming_slots()].into_iter().enumerate() {
            for (warp, seated) in order.chunks(WARP).enumerate() {
                let most = seated.iter().map(|&i| sides[i].rows(kind)).max().unwrap_or(0);
                if used[kind] + WARP * most > room {
                    return Err(RveFailure::SlotsFull { slots: shape.slots });
                }
                for (lane, &i) in seated.iter().enumerate() {
                    let first = used[kind] + lane;
                    let range = [first, first + WARP * sides[i].rows(kind)].map(|n| n as u16);
                    let rows = &mut self.rows[WARP * warp + lane];
                    match kind {
                        0 => [rows.owned, rows.owned_end] = range,
                        _ => [rows.incoming, rows.incoming_end] = range,
                    }
                }
                used[kind] += WARP * most;
            }
        }

        let mut slot_of_pair = vec![0; list.pairs.len()];
        for (seat, &i) in order.iter().enumerate() {
            let Rows { owned: first, owned_end: end, .. } = self.rows[seat];
            for (slot, side) in slots(first, end).zip(&sides[i].0[0]) {
                let (pair, j) = (&list.pairs[side.pair], side.neighbour as usize);
                slot_of_pair[side.pair] = slot;
                self.neighbour[slot] =
                    position_offset::<R>(seat_of[j]) | u32::from(side.image) << 16;
                self.pair[slot] = Vector { x: discs[i].r + discs[j].r, y: pair.dashpot };
                self.tangential[slot] = pair.tangential;
                if let Some(spring) = self.rolling.get_mut(slot) {
                    let rolling = list.rolling.get(side.pair).copied().unwrap_or_default();
                    *spring = from_owner(i, j, rolling);
                }
            }
        }
        for (seat, &i) in order.iter().enumerate() {
            let Rows { incoming: first, incoming_end: end, .. } = self.rows[seat];
            for (slot, side) in slots(first, end).zip(&sides[i].0[1]) {
                self.incoming[slot] = slot_of_pair[side.pair] as u16;
            }
        }
        Ok(used.map(|n| n as u32))
    }

    /// The pairs, each once, in the order of [`Neighbours`], their images and their rolling springs. `imaged`
    /// tells whether the list holds other images than the nearest.
    pub fn get(
        &self,
        imaged: bool,
        discs: &[Disc<R>],
        law: &ContactLaw<R>,
    ) -> (Vec<Pair<R>>, Vec<Image2>, Vec<R>) {
        let disc = |seat: usize| usize::from(self.seated[seat]);
        let mut found = Vec::new();
        for seat in 0..discs.len() {
            let owner = disc(seat);
            let Rows { owned: first, owned_end: end, .. } = self.rows[seat];
            for slot in slots(first, end) {
                let word = self.neighbour[slot];
                let other = disc(((word & 0xffff) / position_offset::<R>(1)) as usize);
                let mut image = (word >> 16) as u16;
                if owner > other && imaged {
                    image = image_code(from_image_code(image).map(reversed));
                }
                let (i, j) = (owner.min(other), owner.max(other));
                let rolling = self.rolling.get(slot).map(|&s| from_owner(owner, other, s));
                found.push((i, j, image, self.tangential[slot], rolling));
            }
        }
        found.sort_unstable_by_key(|&(i, j, image, ..)| (i, j, image));
        let pairs = found
            .iter()
            .map(|&(i, j, _, tangential, _)| Pair {
                i: i as u16,
                j: j as u16,
                tangential,
                dashpot: law.dashpot(&discs[i], &discs[j]),
            })
            .collect();
        let images = found.iter().filter(|_| imaged).map(|f| from_image_code(f.2)).collect();
        let rolling = found.iter().filter_map(|f| f.4).collect();
        (pairs, images, rolling)
    }
}

/// Rolling force of a pair seen from its owner, from that seen from the disc of lower index, or back.
fn from_owner<R: Real>(owner: usize, other: usize, rolling: R) -> R {
    if owner > other { -rolling } else { rolling }
}

/// The slots of a disc: one in every row of its warp.
fn slots(first: u16, end: u16) -> impl Iterator<Item = usize> {
    (usize::from(first)..usize::from(end)).step_by(WARP)
}

/// Offset of a seat in the array of positions (bytes).
fn position_offset<R: Real>(seat: u16) -> u32 {
    u32::from(seat) * size_of::<[R::Fraction; 2]>() as u32
}

fn sides<R: Real>(list: &Neighbours<R>, discs: &[Disc<R>]) -> Vec<Sides> {
    let imaged = !list.images.is_empty();
    let at_search = |i: u16| {
        let i = usize::from(i);
        list.reference.get(i).copied().unwrap_or(discs[i].s)
    };
    let mut sides = vec![Sides::default(); discs.len()];
    for (index, pair) in list.pairs.iter().enumerate() {
        let (there, back) = list
            .images
            .get(index)
            .map_or((0, 0), |&image| (image_code(image), image_code(image.map(reversed))));
        for (i, j, image) in [(pair.i, pair.j, there), (pair.j, pair.i, back)] {
            let up = (!imaged).then(|| R::nearest(at_search(i)[1], at_search(j)[1]).to_f64());
            let side = Side { neighbour: j, image, pair: index };
            sides[i as usize].0[usize::from(!owns(i, j, up, image))].push(side);
        }
    }
    for side in sides.iter_mut().flat_map(|s| &mut s.0) {
        side.sort_unstable_by_key(|s| (s.neighbour, s.image));
    }
    sides
}

/// Which disc of a pair evaluates it, as in `position.cuh`. `up`: second reduced coordinate from
/// `i` to `j`, if only nearest images are listed.
fn owns(i: u16, j: u16, up: Option<f64>, image: u16) -> bool {
    const ZERO_IMAGE: u16 = 64 << 7 | 64;
    match up {
        _ if i == j => image > ZERO_IMAGE,
        Some(up) if up != 0.0 => up > 0.0,
        _ => i < j,
    }
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
