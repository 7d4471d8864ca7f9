//! Which listed pairs touch.

use multiversion::multiversion;

use super::pairs::{BLOCK, Pairs};
use crate::disc::Disc;
use crate::real::Real;

/// A touching pair.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Touching {
    /// Its place among the pairs, and [`BEFORE`].
    index: u32,
    /// Places of its discs.
    pub discs: [u32; 2],
}

/// The bit of a pair that touched in the last step as well.
const BEFORE: u32 = 1 << 31;

impl Touching {
    /// Its place among the pairs.
    #[inline(always)]
    pub fn index(self) -> usize {
        (self.index & !BEFORE) as usize
    }

    /// Whether it touched in the last step as well: its history goes on.
    #[inline(always)]
    pub fn before(self) -> bool {
        self.index & BEFORE != 0
    }
}

/// Lists the touching pairs in a buffer of any length, without branching on whether a pair touches. `unit` is
/// the length of a unit of [`Real::Fraction`] (m). Returns how many there are.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn find_touching<R: Real>(
    pairs: &mut Pairs<R>,
    discs: &[Disc<R>],
    unit: R,
    touching: &mut Vec<Touching>,
) -> usize {
    // One more than can be used: the entry after the last touching pair is written speculatively.
    let longest = touching.len().max(pairs.padded_len() + 1);
    touching.resize(longest, Touching::default());
    let touching = touching.as_mut_slice();
    let mut separation = [[R::default(); 2]; BLOCK];
    let (mut touches, mut index) = ([false; BLOCK], [0; BLOCK]);
    let (mut first, mut count) = (0, 0);
    // Loop by loop: each is then vectorised.
    for block in pairs.blocks() {
        if block.quiet {
            first += BLOCK as u32;
            continue;
        }
        for (separation, &[i, j]) in separation.iter_mut().zip(block.discs) {
            let (a, b) = (&discs[i as usize], &discs[j as usize]);
            *separation = [R::nearest(a.s[0], b.s[0]), R::nearest(a.s[1], b.s[1])];
        }
        for k in 0..BLOCK {
            let [x, y] = separation[k].map(|units| unit * units);
            touches[k] = x * x + y * y < block.reach2[k];
        }
        for (k, (index, &touched)) in index.iter_mut().zip(&*block.touched).enumerate() {
            *index = (first + k as u32) | if touched { BEFORE } else { 0 };
        }
        *block.touched = touches;
        for k in 0..BLOCK {
            touching[count] = Touching { index: index[k], discs: block.discs[k] };
            count += usize::from(touches[k]);
        }
        first += BLOCK as u32;
    }
    count
}
