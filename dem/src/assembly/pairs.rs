//! Pairs that can touch before the next listing, and the history of their contacts.

use serde::{Deserialize, Serialize};

use crate::real::Real;

/// What a contact remembers of the last step; zero while its discs do not touch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub(crate) struct History<R: Real> {
    pub sliding: Sliding<R>,
    pub rolling: Rolling<R>,
}

/// Of its normal and tangential force. The same seen from either disc.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub(crate) struct Sliding<R: Real> {
    /// Tangential spring force (N): positive acts on `j` counter-clockwise around `i`.
    pub tangential: R,
    /// Normal force (N) less that of the spring.
    pub viscous: R,
}

/// Of its resistance against rolling; zero where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub(crate) struct Rolling<R: Real> {
    /// Rolling spring force (N): its torque on `j` over the reduced radius.
    pub spring: R,
    /// The rolling force (N) less that of the spring.
    pub viscous: R,
}

impl<R: Real> History<R> {
    /// The history that the other disc of the pair sees.
    pub fn reversed(self) -> Self {
        let Rolling { spring, viscous } = self.rolling;
        Self { rolling: Rolling { spring: -spring, viscous: -viscous }, ..self }
    }
}

/// Two discs that can touch before the next listing, by their places in the assembly.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Pair<R: Real> {
    /// A disc of the tile.
    pub i: u32,
    pub j: u32,
    pub contact: History<R>,
    /// Normal dashpot (kg/s).
    pub dashpot: R,
}

/// A disc and a rigid box that can touch before the next listing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct BodyPair<R: Real> {
    pub disc: u32,
    pub body: u16,
    pub contact: History<R>,
    /// Normal dashpot (kg/s).
    pub dashpot: R,
}

/// Pairs that are treated together.
pub(super) const BLOCK: usize = 64;

/// Pairs of discs, with what every step reads of all of them apart from what it reads of contacts.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct Pairs<R: Real> {
    /// Places of the two discs. This and the next two go on to a whole number of blocks, with pairs that
    /// never touch.
    discs: Vec<[u32; 2]>,
    /// Square of the sum of the radii (m²).
    reach2: Vec<R>,
    /// Whether the pair touched in the last step.
    touched: Vec<bool>,
    /// Of each block, whether its pairs stay as they are: their discs sleep, and so do all around them.
    quiet: Vec<bool>,
    /// History of the pairs that touched; meaningless for others.
    pub sliding: Vec<Sliding<R>>,
    /// The rest of it; empty without rolling resistance.
    pub rolling: Vec<Rolling<R>>,
    /// Normal dashpots (kg/s).
    pub dashpot: Vec<R>,
}

/// A block of [`Pairs`].
pub(super) struct Block<'a, R: Real> {
    pub discs: &'a [[u32; 2]; BLOCK],
    pub reach2: &'a [R; BLOCK],
    pub touched: &'a mut [bool; BLOCK],
    pub quiet: bool,
}

impl<R: Real> Pairs<R> {
    /// Adds a pair that touches at a distance of `reach` (m), and maybe `resists_rolling`.
    pub fn push(&mut self, pair: Pair<R>, reach: R, resists_rolling: bool) {
        let k = self.sliding.len();
        if k == self.discs.len() {
            self.discs.resize(k + BLOCK, [pair.i; 2]);
            self.reach2.resize(k + BLOCK, R::default());
            self.touched.resize(k + BLOCK, false);
            self.quiet.push(false);
        }
        self.discs[k] = [pair.i, pair.j];
        self.reach2[k] = reach * reach;
        self.touched[k] = pair.contact != History::default();
        self.sliding.push(pair.contact.sliding);
        if resists_rolling {
            self.rolling.push(pair.contact.rolling);
        }
        self.dashpot.push(pair.dashpot);
    }

    pub fn clear(&mut self) {
        self.discs.clear();
        self.reach2.clear();
        self.touched.clear();
        self.quiet.clear();
        self.sliding.clear();
        self.rolling.clear();
        self.dashpot.clear();
    }

    /// Number of pairs in all blocks.
    pub fn padded_len(&self) -> usize {
        self.discs.len()
    }

    #[inline(always)]
    pub fn blocks(&mut self) -> impl Iterator<Item = Block<'_, R>> {
        let (discs, _) = self.discs.as_chunks();
        let (reach2, _) = self.reach2.as_chunks();
        let (touched, _) = self.touched.as_chunks_mut();
        let blocks = discs.iter().zip(reach2).zip(touched).zip(&self.quiet);
        blocks.map(|(((discs, reach2), touched), &quiet)| Block { discs, reach2, touched, quiet })
    }

    /// Notes which blocks stay as they are, by their discs; each may ask for a place.
    pub fn find_quiet(&mut self, is_quiet: impl Fn(u32) -> bool) {
        let blocks = self.discs.chunks(BLOCK).zip(&mut self.quiet);
        for (discs, quiet) in blocks {
            *quiet = discs.iter().flatten().all(|&place| is_quiet(place));
        }
    }

    /// Places of the discs of each pair.
    pub fn places(&self) -> impl Iterator<Item = [u32; 2]> {
        self.discs[..self.sliding.len()].iter().copied()
    }

    pub fn iter(&self) -> impl Iterator<Item = Pair<R>> {
        let pairs = self.discs.iter().zip(&self.touched).zip(&self.sliding).zip(&self.dashpot);
        pairs.enumerate().map(|(k, (((&[i, j], &touched), &sliding), &dashpot))| {
            let history = || History { sliding, rolling: self.rolling_of(k) };
            let contact = if touched { history() } else { History::default() };
            Pair { i, j, contact, dashpot }
        })
    }

    /// What a pair remembers of rolling.
    fn rolling_of(&self, pair: usize) -> Rolling<R> {
        self.rolling.get(pair).copied().unwrap_or_default()
    }
}
