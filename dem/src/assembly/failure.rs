//! Which grain failed, where and why.

use super::error::{AssemblyError, GrainFailure};
use super::state::{Assembly, Buffer};
use crate::disc::Disc;
use crate::real::Real;

impl<R: Real> Assembly<R> {
    /// The grain that failed, where it is and why.
    pub(super) fn failure(&self, overlap: f64) -> AssemblyError {
        let (place, failure) = self.failed_grain(overlap);
        AssemblyError::Grain {
            step: self.steps,
            grain: self.ids[place] as usize,
            position: self.region.decode::<R>(self.discs[place].s),
            failure,
        }
    }

    fn failed_grain(&self, overlap: f64) -> (usize, GrainFailure) {
        let moves = |disc: &Disc<R>| disc.u.iter().chain([&disc.w]).all(|x| x.to_f64().is_finite());
        if let Some(place) = self.discs.iter().position(|disc| !moves(disc)) {
            return (place, GrainFailure::NotFinite);
        }
        // The forces were those at the positions before the move.
        let Buffer(before) = &self.next;
        let inside = |disc: &Disc<R>| {
            let x = self.region.decode::<R>(disc.s);
            let fixed = disc.inv_mass == R::default();
            !fixed && self.bodies.iter().any(|b| b.branch(x, self.time - self.dt) == [0.0; 2])
        };
        if let Some(place) = before.iter().position(inside) {
            return (place, GrainFailure::Leak);
        }
        let deepest = self.tiles.iter().flat_map(|tile| {
            let pairs = tile.inner.iter().chain(tile.outer.iter());
            pairs.map(|pair| (pair.i as usize, pair.j as usize))
        });
        let relative = |&(i, j): &(usize, usize)| {
            let (a, b): (&Disc<R>, &Disc<R>) = (&before[i], &before[j]);
            let unit = self.region.unit::<R>();
            let [x, y] = [0, 1].map(|k| R::nearest(a.s[k], b.s[k]).to_f64() * unit);
            (a.r.to_f64() + b.r.to_f64() - x.hypot(y)) / a.r.to_f64().min(b.r.to_f64())
        };
        let deepest = deepest.max_by(|a, b| relative(a).total_cmp(&relative(b)));
        let place = deepest.map_or(0, |(i, _)| i);
        (place, GrainFailure::Overlap(overlap))
    }
}
