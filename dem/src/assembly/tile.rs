//! Tiles: square parts of an assembly that are advanced in parallel, each with the pairs of its discs.
//!
//! A pair of discs in one tile is evaluated once. A pair across a border is evaluated by both tiles: the law
//! is antisymmetric in its two discs to the last bit, and each tile uses its side. No tile writes what
//! another one reads during a step, so results do not depend on the number of threads.

use serde::{Deserialize, Serialize};

use super::bodies::evaluate_bodies;
use super::contacts::evaluate;
use super::motion::{hold, integrate, resist};
use super::pairs::{BodyPair, Pairs};
use super::sleep::Rest;
use super::step::{Step, TileSums};
use super::touching::{Touching, find_touching};
use crate::disc::Disc;
use crate::real::Real;

/// Discs `first..end` of the assembly and their pairs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct Tile<R: Real> {
    /// Column and row of the tile.
    pub place: [u32; 2],
    pub first: u32,
    pub end: u32,
    /// Places in the list of tiles: this tile and those around it.
    pub around: Vec<u32>,
    /// Discs of other tiles that can come near before the next sort.
    pub halo: Vec<u32>,
    /// Pairs of own discs, in the order of the first one, the smaller.
    pub inner: Pairs<R>,
    /// Pairs of an own disc and one of the halo, in the order of the first one, the own.
    pub outer: Pairs<R>,
    /// In the order of discs, then of bodies.
    pub bodies: Vec<BodyPair<R>>,
    /// Positions of the own discs and of the halo when pairs were listed.
    pub reference: Vec<[R::Fraction; 2]>,
    /// When pairs were listed (s).
    pub listed: f64,
    /// Upper bound of the displacement of any of these discs since then (m).
    pub travel: f64,
    /// Number of own discs that nothing is computed of, as they sleep and so do all around them.
    pub quiet: u32,
    /// Whether these are all own discs.
    pub left_out: bool,
}

/// Buffers of a step, which tiles share one after the other.
#[derive(Clone, Debug, Default)]
pub(super) struct Work<R: Real> {
    /// Force (N), torque (N m) and sum of normal forces (N) on each own disc.
    forces: Vec<[R; 4]>,
    /// The touching pairs, then unused entries.
    touching: Vec<Touching>,
}

impl<R: Real> Tile<R> {
    /// Number of own discs.
    pub fn len(&self) -> usize {
        (self.end - self.first) as usize
    }

    /// Own discs, then the halo, by their places in the assembly.
    pub fn nearby(&self) -> impl Iterator<Item = u32> {
        (self.first..self.end).chain(self.halo.iter().copied())
    }

    /// Largest displacement of a nearby disc since pairs were listed, in units of [`Real::Fraction`].
    pub fn displacement(&self, discs: &[Disc<R>]) -> f64 {
        let squares = self.nearby().zip(&self.reference).map(|(k, reference)| {
            let s = discs[k as usize].s;
            let [x, y] = [0, 1].map(|k| R::nearest(reference[k], s[k]).to_f64());
            x * x + y * y
        });
        squares.fold(0.0, f64::max).sqrt()
    }

    /// Advances the own discs by one step, from the assembly's `discs` into `next`. Those whose `rest` says so are held;
    /// where none ever is, it is empty.
    pub fn advance(
        &mut self,
        step: &Step<'_, R>,
        discs: &[Disc<R>],
        next: &mut [Disc<R>],
        rest: &mut [Rest<R>],
        work: &mut Work<R>,
    ) -> TileSums<R> {
        let left_out = TileSums { skipped: self.quiet, ..TileSums::default() };
        if self.left_out {
            next.copy_from_slice(&discs[self.first as usize..self.end as usize]);
            return left_out;
        }
        let Self { inner, outer, bodies, first, end, .. } = self;
        let Work { forces, touching } = work;
        let own = *first as usize..*end as usize;
        forces.clear();
        forces.resize(own.len(), [R::default(); 4]);
        let mut sums = left_out;
        let rolling = step.law.resists_rolling();
        let count = find_touching(inner, discs, step.unit, touching);
        let contacts = &touching[..count];
        let evaluate_inner =
            if rolling { evaluate::<R, true, true> } else { evaluate::<R, true, false> };
        evaluate_inner(inner, contacts, discs, *first, forces, step, &mut sums);
        let count = find_touching(outer, discs, step.unit, touching);
        let contacts = &touching[..count];
        let evaluate_outer =
            if rolling { evaluate::<R, false, true> } else { evaluate::<R, false, false> };
        evaluate_outer(outer, contacts, discs, *first, forces, step, &mut sums);
        evaluate_bodies(bodies, discs, *first, forces, step, &mut sums);
        let own = &discs[own];
        if step.law.local_damping != R::default() || step.drag != R::default() {
            resist(own, forces, step, &mut sums);
        }
        integrate(own, forces, step, next, &mut sums);
        hold(own, forces, step, rest, next);
        sums
    }
}
