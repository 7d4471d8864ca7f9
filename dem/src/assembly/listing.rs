//! When the discs of an assembly are sorted and their neighbours listed.

use rayon::prelude::*;

use super::memory::ContactMemory;
use super::search::{Bins, Search, sort};
use super::state::Assembly;
use super::tile::Tile;
use crate::contact::ContactLaw;
use crate::real::Real;

impl<R: Real> Assembly<R> {
    /// Whether a disc may have moved too far for the order of discs and tiles.
    pub(super) fn unsorted(&mut self) -> bool {
        let allowed = self.bins().drift();
        if self.travel <= allowed {
            return false;
        }
        self.travel = self.displacement();
        self.travel > allowed || self.travel.is_nan()
    }

    /// Whether a pair outside of the lists of a tile may touch now. A pair not listed was further apart than
    /// touch and the skin; two discs, or a disc and a box, close in on each other by no more than twice the
    /// largest displacement.
    pub(super) fn outdated(&self, tile: &mut Tile<R>) -> bool {
        let allowed = 0.5 * self.skin();
        let boxes = self.bodies.iter().map(|body| {
            let [[ax, ay], [bx, by]] = [tile.listed, self.time].map(|t| body.displacement(t));
            (ax - bx).hypot(ay - by)
        });
        if boxes.fold(0.0, f64::max) > allowed {
            return true;
        }
        if tile.travel <= allowed {
            return false;
        }
        tile.travel = tile.displacement(&self.discs) * self.region.unit::<R>();
        tile.travel > allowed
    }

    /// Largest displacement since the last search (m).
    fn displacement(&self) -> f64 {
        let unit = self.region.unit::<R>();
        let squares = self.discs.par_iter().zip(&self.reference).map(|(disc, reference)| {
            let [x, y] = [0, 1].map(|k| R::nearest(reference[k], disc.s[k]).to_f64() * unit);
            x * x + y * y
        });
        squares.reduce(|| 0.0, f64::max).sqrt()
    }

    /// Searches neighbours at the present positions; touching pairs keep their history.
    pub(super) fn search(&mut self) {
        self.search_with(Self::memory);
    }

    pub(crate) fn search_with(&mut self, memory: impl FnOnce(&Self) -> ContactMemory<R>) {
        let memory = memory(self);
        let bins = self.bins();
        // New pairs may be with discs that move.
        self.rest.iter_mut().for_each(|rest| rest.quiet = false);
        sort(&mut self.discs, &mut self.ids, &mut self.rest, &bins);
        self.tiles = self.searcher(&self.law()).tiles(&self.ids, &memory);
        self.reference.clear();
        self.reference.extend(self.discs.iter().map(|disc| disc.s));
        self.travel = 0.0;
        self.searches += 1;
    }

    /// Tiles with lists that hold at the present positions, for output. Those of the assembly are renewed by
    /// the next step, so that results do not depend on when output is made.
    pub(super) fn listed(&self) -> Vec<Tile<R>> {
        let law = self.law();
        let search = self.searcher(&law);
        let listed = self.tiles.par_iter().map(|tile| {
            let mut tile = tile.clone();
            if self.outdated(&mut tile) {
                search.renew(&mut tile);
            }
            tile
        });
        listed.collect()
    }

    /// The history of all contacts.
    pub(crate) fn memory(&self) -> ContactMemory<R> {
        ContactMemory::of_tiles(&self.tiles, &self.ids)
    }

    fn bins(&self) -> Bins {
        Bins::new(&self.grains, self.region, self.skin())
    }

    pub(super) fn searcher<'a>(&'a self, law: &'a ContactLaw<R>) -> Search<'a, R> {
        Search {
            law,
            bins: self.bins(),
            skin: self.skin(),
            discs: &self.discs,
            bodies: &self.bodies,
            time: self.time,
        }
    }
}
