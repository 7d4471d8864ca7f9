//! The advance of an assembly in time.

use rayon::prelude::*;

use super::boundary::Body;
use super::energy::Losses;
use super::error::AssemblyError;
use super::sleep::Rest;
use super::state::{Assembly, Buffer};
use super::step::{Step, TileSums};
use super::tile::{Tile, Work};
use crate::disc::Disc;
use crate::real::Real;

/// A tile with the next state and the rest of its discs.
type Part<'a, R> = (&'a mut Tile<R>, &'a mut [Disc<R>], &'a mut [Rest<R>]);

impl<R: Real> Assembly<R> {
    /// Advances by `steps` DEM steps.
    ///
    /// # Errors
    /// A grain overlaps another one beyond the limit, leaves through a wall, or has a velocity that is not
    /// finite. The assembly is then not usable further.
    pub fn advance(&mut self, steps: usize) -> Result<(), AssemblyError> {
        for _ in 0..steps {
            if self.unsorted() {
                self.search();
            }
            self.step()?;
        }
        Ok(())
    }

    /// What acts on all tiles in the next step, with these bodies.
    fn next_step<'a>(&self, bodies: &'a [Body<R>]) -> Step<'a, R> {
        Step {
            law: self.law(),
            unit: R::from_f64(self.region.unit::<R>()),
            gravity: self.gravity.map(R::from_f64),
            drag: R::from_f64(self.drag),
            bodies,
            tolerance: R::from_f64(self.sleep.map_or(0.0, |sleep| sleep.force)),
        }
    }

    fn step(&mut self) -> Result<(), AssemblyError> {
        let bodies = self.bodies_now();
        let step = self.next_step(&bodies);
        let mut tiles = std::mem::take(&mut self.tiles);
        let Buffer(mut next) = std::mem::take(&mut self.next);
        next.resize(self.discs.len(), Disc::default());
        let mut rest = std::mem::take(&mut self.rest);
        let (mut free, mut resting) = (next.as_mut_slice(), rest.as_mut_slice());
        let mut parts = Vec::with_capacity(tiles.len());
        for tile in &mut tiles {
            let (of_next, others) = free.split_at_mut(tile.len());
            let (of_rest, awaiting) = resting.split_at_mut(tile.len().min(resting.len()));
            parts.push((tile, of_next, of_rest));
            (free, resting) = (others, awaiting);
        }
        let search = self.searcher(&step.law);
        let advance = |buffers: &mut Work<R>, (tile, next, rest): Part<'_, R>| {
            if self.outdated(tile) {
                search.renew(tile);
                // New pairs may be with discs that move.
                (tile.quiet, tile.left_out) = (0, false);
                rest.iter_mut().for_each(|rest| rest.quiet = false);
            }
            tile.advance(&step, &self.discs, next, rest, buffers)
        };
        let sums: Vec<TileSums<R>> =
            parts.into_par_iter().map_init(Work::default, advance).collect();
        self.tiles = tiles;
        self.rest = rest;
        self.next = Buffer(std::mem::replace(&mut self.discs, next));
        self.steps += 1;
        self.time += self.dt;
        self.add(&sums)?;
        self.look();
        Ok(())
    }

    /// Adds up what tiles report.
    fn add(&mut self, sums: &[TileSums<R>]) -> Result<(), AssemblyError> {
        let (mut fastest, mut overlap, mut finite) = (0.0_f64, 0.0_f64, true);
        for tile in sums {
            let speed = tile.fastest.to_f64();
            finite &= speed.is_finite();
            fastest = fastest.max(speed);
            overlap = overlap.max(tile.overlap.to_f64());
            self.skipped += u64::from(tile.skipped);
            self.losses += Losses {
                dashpots: self.dt * tile.dashpots.to_f64(),
                friction: self.dt * tile.friction.to_f64(),
                damping: self.dt * tile.damping.to_f64(),
                boxes: self.dt * tile.boxes.to_f64(),
            };
        }
        self.travel += fastest * self.dt;
        for tile in &mut self.tiles {
            let around = tile.around.iter().map(|&k| sums[k as usize].fastest.to_f64());
            tile.travel += around.fold(0.0, f64::max) * self.dt;
        }
        if !finite || overlap > self.grains.overlap_limit {
            return Err(self.failure(overlap));
        }
        self.max_overlap = self.max_overlap.max(overlap);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assembly::{Boundary, Faces, Floor, Grain, Packed, Sleep};
    use crate::grains::Grains;

    /// Grains that fall onto a floor of 0.6 m, three tiles wide, and one that falls later.
    fn heap() -> Assembly<f32> {
        let grains = Grains { damping_ratio: 0.9, ..Grains::default() };
        let gravity = [0.0, -9.81];
        let sides = Faces { left: 0.5, right: 0.5, bottom: 0.5, top: 0.5 };
        let (corner, size) = ([0.0; 2], [0.6, 0.5]);
        let (floor, boxes, seed) = (Floor::Rough, Vec::new(), 1);
        let boundary = Boundary { corner, size, walls: sides, floor, boxes, seed };
        let mut packed = Packed::default();
        for k in 0..300 {
            let (i, j) = (k % 58, k / 58);
            let r = 2.5e-3 + 2.5e-3 * f64::from(k * 37 % 100) / 100.0;
            let x = [0.0101 * f64::from(i) + 0.007, 0.0101 * f64::from(j) + 0.005];
            packed.grains.push(Grain { x, v: [0.0; 2], w: 0.0, r });
        }
        packed.grains.push(Grain { x: [0.1, 0.3], v: [0.0, 2.2], w: 0.0, r: 5e-3 });
        let step = grains.step();
        let mut heap = Assembly::new(&grains, &boundary, gravity, step, &packed).unwrap();
        let sleep = Sleep::of(&grains, gravity, 1);
        heap.set_sleep(sleep.map(|sleep| Sleep { distance: 1.0e-3, audit: 0.0, ..sleep }));
        heap
    }

    /// What is left out is what a step would leave as it is, bit by bit: positions, springs, and the forces that
    /// sleeping discs feel. The late grain is in the air for 0.58 s.
    #[test]
    fn what_is_left_out_changes_nothing() {
        let mut heap = heap();
        let (mut compared, mut most, mut woken) = (0, 0, false);
        for _ in 0..60 {
            heap.advance(1001).unwrap();
            let bodies = heap.bodies_now();
            let step = heap.next_step(&bodies);
            let held = heap.held();
            woken |= held < most;
            most = most.max(held);
            for tile in heap.tiles.iter().filter(|tile| tile.quiet > 0) {
                let own = tile.first as usize..tile.end as usize;
                let run = |mut tile: Tile<f32>, mut rest: Vec<Rest<f32>>| {
                    let mut next = vec![Disc::default(); own.len()];
                    tile.advance(&step, &heap.discs, &mut next, &mut rest, &mut Work::default());
                    let pairs: Vec<_> = tile.inner.iter().chain(tile.outer.iter()).collect();
                    rest.iter_mut().for_each(|rest| rest.quiet = false);
                    (next, rest, pairs, tile.bodies)
                };
                let rest = &heap.rest[own.clone()];
                let mut all = tile.clone();
                (all.quiet, all.left_out) = (0, false);
                all.inner.find_quiet(|_| false);
                all.outer.find_quiet(|_| false);
                let feeling = rest.iter().map(|&rest| Rest { quiet: false, ..rest }).collect();
                assert!(run(tile.clone(), rest.to_vec()) == run(all, feeling));
                compared += tile.quiet;
            }
        }
        assert!(compared > 1000 && woken, "{compared} discs, at most {most} held");
    }
}
