//! Looks at which grains of an assembly rest, and at what around them moves.

use rayon::prelude::*;

use super::sleep::{LOOK, Look, Rest, Sleep, State};
use super::state::Assembly;
use super::tile::Tile;
use crate::disc::Disc;
use crate::real::Real;

/// What the discs of a tile may touch.
#[derive(Clone, Copy, Default)]
struct Around {
    /// Whether not all of it is asleep.
    wakeful: bool,
    /// Whether some of it moves.
    moves: bool,
}

impl Around {
    fn add(&mut self, other: Self) {
        self.wakeful |= other.wakeful;
        self.moves |= other.moves;
    }
}

impl<R: Real> Assembly<R> {
    /// Holds grains that rest from now on, or none.
    pub fn set_sleep(&mut self, sleep: Option<Sleep>) {
        self.sleep = sleep;
        self.rest.clear();
        if sleep.is_some() {
            let awake = |disc: &Disc<R>| Rest { place: disc.s, ..Rest::default() };
            self.rest.extend(self.discs.iter().map(awake));
        }
        for tile in &mut self.tiles {
            (tile.quiet, tile.left_out) = (0, false);
            tile.inner.find_quiet(|_| false);
            tile.outer.find_quiet(|_| false);
        }
    }

    /// Steps of single grains that were left out, as nothing around them moved.
    pub fn skipped(&self) -> u64 {
        self.skipped
    }

    /// Largest displacement of a grain that was computed though it would have been held (m).
    pub fn audit(&self) -> f64 {
        self.audit
    }

    /// Number of grains that are held.
    pub fn held(&self) -> usize {
        self.rest.iter().filter(|rest| rest.state.is_held()).count()
    }

    /// Looks which grains rest, every [`LOOK`] steps.
    pub(super) fn look(&mut self) {
        let Some(sleep) = self.sleep.filter(|_| self.steps.is_multiple_of(LOOK)) else { return };
        let look = Look {
            unit: R::from_f64(self.region.unit::<R>()),
            distance: R::from_f64(sleep.distance),
            speed: R::from_f64(sleep.speed),
            looks: sleep.looks(self.dt),
            patches: sleep.patches(self.region.side),
            audited: sleep.audited(),
            seed: sleep.seed,
        };
        let discs = self.discs.par_iter_mut().zip(&mut self.rest);
        let lost = discs.map(|(disc, rest)| match disc.inv_mass == R::default() {
            true => 0.0,
            false => rest.look(&look, disc),
        });
        // One after the other: the same bits for any number of threads.
        self.losses.damping += lost.collect::<Vec<f64>>().iter().sum::<f64>();
        self.look_around();
    }

    /// Looks what around the grains moves: which of them nothing has to be computed of, and how far those have moved
    /// that are watched.
    fn look_around(&mut self) {
        let around: Vec<Option<Vec<Around>>> =
            self.tiles.par_iter().map(|tile| self.around(tile)).collect();
        let unit = R::from_f64(self.region.unit::<R>());
        let mut audit = 0.0_f64;
        let mut quiet = vec![false; self.tiles.len()];
        for ((tile, around), quiet) in self.tiles.iter_mut().zip(&around).zip(&mut quiet) {
            *quiet = tile.quiet > 0;
            (tile.quiet, tile.left_out) = (0, around.is_some());
            let Some(around) = around else { continue };
            let own = tile.first as usize..tile.end as usize;
            for ((rest, disc), around) in
                self.rest[own.clone()].iter_mut().zip(&self.discs[own]).zip(around)
            {
                let fixed = disc.inv_mass == R::default();
                rest.quiet = rest.state == State::Asleep && !around.wakeful;
                tile.left_out &= rest.quiet || fixed;
                tile.quiet += u32::from(rest.quiet);
                if rest.state == State::Watched && !around.moves {
                    let [x, y] = rest.moved(unit, disc).map(R::to_f64);
                    audit = audit.max(x.hypot(y));
                }
                rest.disturbed |= rest.state == State::Watched && around.moves;
            }
            *quiet |= tile.quiet > 0;
        }
        self.audit = self.audit.max(audit);
        let (rest, discs) = (&self.rest, &self.discs);
        let is_quiet = |place: u32| {
            let place = place as usize;
            rest[place].quiet || discs[place].inv_mass == R::default()
        };
        // Of other tiles no block is quiet, nor was.
        let tiles = self.tiles.par_iter_mut().zip(quiet).filter(|&(_, quiet)| quiet);
        tiles.for_each(|(tile, _)| {
            tile.inner.find_quiet(is_quiet);
            tile.outer.find_quiet(is_quiet);
        });
    }

    /// What is around each disc of a tile; `None` if all of them are awake.
    fn around(&self, tile: &Tile<R>) -> Option<Vec<Around>> {
        let own = tile.first as usize..tile.end as usize;
        if self.rest[own].iter().all(|rest| rest.state == State::Awake) {
            return None;
        }
        let first = tile.first as usize;
        let seen = |k: usize| {
            let state = self.rest[k].state;
            let mobile = self.discs[k].inv_mass != R::default();
            let (wakeful, moves) = (state != State::Asleep, state == State::Awake);
            Around { wakeful: mobile && wakeful, moves: mobile && moves }
        };
        let mut around = vec![Around::default(); tile.len()];
        for (pairs, inner) in [(&tile.inner, true), (&tile.outer, false)] {
            for [i, j] in pairs.places().map(|pair| pair.map(|place| place as usize)) {
                around[i - first].add(seen(j));
                if inner {
                    around[j - first].add(seen(i));
                }
            }
        }
        for pair in &tile.bodies {
            let moves = self.bodies[usize::from(pair.body)].velocity != [0.0; 2];
            around[pair.disc as usize - first].add(Around { wakeful: moves, moves });
        }
        Some(around)
    }
}
