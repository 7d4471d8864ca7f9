//! The state of a whole scene of discs, and its advance in time.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::boundary::{Body, Boundary, RigidBox};
use super::coordinates::Region;
use super::energy::Losses;
use super::error::{AssemblyError, GrainFailure};
use super::memory::ContactMemory;
use super::packed::{Grain, Packed, PackedContact, Partner};
use super::pairs::{History, Rolling, Sliding};
use super::search::{Bins, Search, sort};
use super::step::{Step, TileSums};
use super::tile::{Tile, Work};
use crate::contact::ContactLaw;
use crate::disc::Disc;
use crate::grains::Grains;
use crate::real::Real;

/// Discs in a bounded domain with rigid walls, boxes and a floor: a complete scene.
///
/// Every step evaluates the contacts of all discs and moves them. Neighbours are listed anew before any pair
/// outside of the lists could touch. Results have the same bits for any number of threads.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Assembly<R: Real> {
    pub(crate) grains: Grains,
    /// Width and height of the domain (m).
    pub(crate) size: [f64; 2],
    pub(crate) bodies: Vec<RigidBox>,
    pub(crate) gravity: [f64; 2],
    /// DEM step (s).
    pub(crate) dt: f64,
    /// See [`Self::set_drag`].
    pub(crate) drag: f64,
    pub(crate) region: Region,
    /// Simulated time (s).
    pub(crate) time: f64,
    /// Steps since the start.
    pub(crate) steps: u64,
    /// In the order of tiles, as of the last search.
    pub(crate) discs: Vec<Disc<R>>,
    /// Identity of each: index in [`Packed::grains`], then the fixed grains of the floor.
    pub(crate) ids: Vec<u32>,
    /// Number of grains that move.
    pub(crate) mobile: usize,
    pub(super) tiles: Vec<Tile<R>>,
    /// Positions at the last search.
    pub(super) reference: Vec<[R::Fraction; 2]>,
    /// Upper bound of the displacement of any disc since then (m).
    travel: f64,
    /// Searches since the start.
    pub(crate) searches: u64,
    pub(crate) losses: Losses,
    /// Largest overlap over the smaller radius since the start.
    pub(crate) max_overlap: f64,
    #[serde(skip)]
    next: Buffer<R>,
}

/// The discs of the next step, and of the last one after it. No part of the state.
#[derive(Clone, Debug, Default)]
struct Buffer<R: Real>(Vec<Disc<R>>);

impl<R: Real> PartialEq for Buffer<R> {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl<R: Real> Assembly<R> {
    /// Grains within a boundary under `gravity` (m/s²), to be advanced in steps of `dt` (s).
    ///
    /// # Errors
    /// A grain lies outside of the domain or inside a box.
    pub fn new(
        grains: &Grains,
        boundary: &Boundary,
        gravity: [f64; 2],
        dt: f64,
        packed: &Packed,
    ) -> Result<Self, AssemblyError> {
        let margin = 2.0 * grains.radius_max;
        let region = Region::around(boundary.corner, boundary.upper_corner(), margin);
        let disc = |x: [f64; 2], v: [f64; 2], w: f64, r: f64, mobile: bool| {
            let mass = grains.mass_scale * grains.disc_mass(r);
            let inverse = |m: f64| R::from_f64(if mobile { 1.0 / m } else { 0.0 });
            Disc {
                s: region.encode::<R>(x),
                u: v.map(R::from_f64),
                w: R::from_f64(w),
                r: R::from_f64(r),
                inv_mass: inverse(mass),
                inv_inertia: inverse(0.5 * mass * r * r),
            }
        };
        let bodies = boundary.bodies(grains);
        for (index, grain) in packed.grains.iter().enumerate() {
            let error = |failure| {
                Err(AssemblyError::Grain { step: 0, grain: index, position: grain.x, failure })
            };
            if !grain.x.iter().chain(&grain.v).chain([&grain.w, &grain.r]).all(|x| x.is_finite()) {
                return error(GrainFailure::NotFinite);
            }
            if !region.contains(grain.x) {
                return error(GrainFailure::Outside);
            }
            if bodies.iter().any(|body| body.branch(grain.x, 0.0) == [0.0; 2]) {
                return error(GrainFailure::Leak);
            }
        }
        let mobile = packed.grains.iter().map(|g| disc(g.x, g.v, g.w, g.r, true));
        let fixed = boundary.floor_grains(grains);
        let fixed = fixed.into_iter().map(|(x, r)| disc(x, [0.0; 2], 0.0, r, false));
        let discs: Vec<Disc<R>> = mobile.chain(fixed).collect();
        let mut assembly = Self {
            grains: grains.clone(),
            size: boundary.size,
            bodies,
            gravity,
            dt,
            drag: 0.0,
            region,
            time: 0.0,
            steps: 0,
            ids: (0..discs.len() as u32).collect(),
            discs,
            mobile: packed.grains.len(),
            tiles: Vec::new(),
            reference: Vec::new(),
            travel: 0.0,
            searches: 0,
            losses: Losses::default(),
            max_overlap: 0.0,
            next: Buffer::default(),
        };
        let count = assembly.discs.len();
        assembly.search_with(|_| memory(packed, count));
        Ok(assembly)
    }

    /// Number of grains that move.
    pub fn len(&self) -> usize {
        self.mobile
    }

    /// Whether there are no grains that move.
    pub fn is_empty(&self) -> bool {
        self.mobile == 0
    }

    /// DEM step (s).
    pub fn dt(&self) -> f64 {
        self.dt
    }

    /// Simulated time (s).
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Sets the time (s), which sums of steps would drift from.
    pub fn set_time(&mut self, time: f64) {
        self.time = time;
    }

    /// DEM steps since the start.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Searches for neighbours since the start.
    pub fn searches(&self) -> u64 {
        self.searches
    }

    /// Largest overlap of two grains since the start, over the radius of the smaller one.
    pub fn max_overlap(&self) -> f64 {
        self.max_overlap
    }

    /// A resistance to all motion: velocities decay at `rate` (1/s). Preparations use it.
    pub fn set_drag(&mut self, rate: f64) {
        self.drag = rate;
    }

    /// Kinetic energy over what lifts every grain by a mean diameter against `gravity` (m/s²).
    pub fn agitation(&self, gravity: f64) -> f64 {
        let mobile = self.discs.iter().filter(|disc| disc.inv_mass != R::default());
        self.agitation_of(mobile.map(|disc| (disc.inv_mass, disc.u)), gravity)
    }

    /// The same for grains of these inverse masses (1/kg) and velocities (m/s).
    pub(crate) fn agitation_of(
        &self,
        grains: impl Iterator<Item = (R, [R; 2])>,
        gravity: f64,
    ) -> f64 {
        let (mut energy, mut mass) = (0.0, 0.0);
        for (inverse, velocity) in grains {
            let m = 1.0 / inverse.to_f64();
            let [u, v] = velocity.map(R::to_f64);
            energy += 0.5 * m * (u * u + v * v);
            mass += m;
        }
        energy / (mass * gravity * self.grains.mean_diameter())
    }

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

    fn step(&mut self) -> Result<(), AssemblyError> {
        let (law, bodies) = (self.law(), self.bodies_now());
        let step = Step {
            law,
            unit: R::from_f64(self.region.unit::<R>()),
            gravity: self.gravity.map(R::from_f64),
            drag: R::from_f64(self.drag),
            bodies: &bodies,
        };
        let mut tiles = std::mem::take(&mut self.tiles);
        let Buffer(mut next) = std::mem::take(&mut self.next);
        next.resize(self.discs.len(), Disc::default());
        let mut rest = next.as_mut_slice();
        let mut parts = Vec::with_capacity(tiles.len());
        for tile in &mut tiles {
            let (slice, others) = rest.split_at_mut(tile.len());
            parts.push((tile, slice));
            rest = others;
        }
        let search = self.searcher(&law);
        let advance = |buffers: &mut Work<R>, (tile, next): (&mut Tile<R>, &mut [Disc<R>])| {
            if self.outdated(tile) {
                search.renew(tile);
            }
            tile.advance(&step, &self.discs, next, buffers)
        };
        let sums: Vec<TileSums<R>> =
            parts.into_par_iter().map_init(Work::default, advance).collect();
        self.tiles = tiles;
        self.next = Buffer(std::mem::replace(&mut self.discs, next));
        self.steps += 1;
        self.time += self.dt;
        self.add(&sums)
    }

    /// Adds up what tiles report.
    fn add(&mut self, sums: &[TileSums<R>]) -> Result<(), AssemblyError> {
        let (mut fastest, mut overlap, mut finite) = (0.0_f64, 0.0_f64, true);
        for tile in sums {
            let speed = tile.fastest.to_f64();
            finite &= speed.is_finite();
            fastest = fastest.max(speed);
            overlap = overlap.max(tile.overlap.to_f64());
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

    /// Whether a disc may have moved too far for the order of discs and tiles.
    fn unsorted(&mut self) -> bool {
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
    fn outdated(&self, tile: &mut Tile<R>) -> bool {
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
        sort(&mut self.discs, &mut self.ids, &bins);
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

    fn bins(&self) -> Bins {
        Bins::new(&self.grains, self.region, self.skin())
    }

    fn searcher<'a>(&'a self, law: &'a ContactLaw<R>) -> Search<'a, R> {
        Search {
            law,
            bins: self.bins(),
            skin: self.skin(),
            discs: &self.discs,
            bodies: &self.bodies,
            time: self.time,
        }
    }

    /// How far lists reach beyond touch (m).
    pub(crate) fn skin(&self) -> f64 {
        self.grains.skin * self.grains.radius_max
    }

    pub(super) fn law(&self) -> ContactLaw<R> {
        ContactLaw::new(&self.grains, self.dt)
    }

    pub(super) fn bodies_now(&self) -> Vec<Body<R>> {
        self.bodies.iter().map(|body| Body::new(body, &self.region, self.time)).collect()
    }

    /// The grain that failed, where it is and why.
    fn failure(&self, overlap: f64) -> AssemblyError {
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

    /// The history of all contacts.
    pub(crate) fn memory(&self) -> ContactMemory<R> {
        ContactMemory::of_tiles(&self.tiles, &self.ids)
    }

    /// Grains and contacts as plain numbers.
    pub fn packed(&self) -> Packed {
        let mut grains = vec![Grain::default(); self.mobile];
        for (disc, &id) in self.discs.iter().zip(&self.ids) {
            if let Some(grain) = grains.get_mut(id as usize) {
                grain.x = self.region.decode::<R>(disc.s);
                grain.v = disc.u.map(R::to_f64);
                grain.w = disc.w.to_f64();
                grain.r = disc.r.to_f64();
            }
        }
        let memory = self.memory();
        let contacts = memory.contacts().map(|(grain, partner, history)| {
            let partner = match (partner.checked_sub(self.mobile as u32), partner) {
                (None, grain) => Partner::Grain(grain),
                (Some(floor), _) => Partner::Floor(floor),
            };
            packed_contact(grain, partner, &history)
        });
        let bodies = memory.body_contacts().into_iter().map(|(grain, body, history)| {
            packed_contact(grain, Partner::Body(u32::from(body)), &history)
        });
        let mut contacts: Vec<PackedContact> = contacts.chain(bodies).collect();
        contacts.sort_by_key(|contact| (contact.grain, contact.partner));
        Packed { grains, contacts }
    }
}

fn packed_contact<R: Real>(grain: u32, partner: Partner, history: &History<R>) -> PackedContact {
    PackedContact {
        grain,
        partner,
        tangential: history.sliding.tangential.to_f64(),
        viscous: history.sliding.viscous.to_f64(),
        rolling: history.rolling.spring.to_f64(),
        rolling_viscous: history.rolling.viscous.to_f64(),
    }
}

/// The contacts of packed grains.
fn memory<R: Real>(packed: &Packed, discs: usize) -> ContactMemory<R> {
    let mobile = packed.grains.len() as u32;
    let real = R::from_f64;
    let history = |contact: &PackedContact| History {
        sliding: Sliding { tangential: real(contact.tangential), viscous: real(contact.viscous) },
        rolling: Rolling { spring: real(contact.rolling), viscous: real(contact.rolling_viscous) },
    };
    let (mut pairs, mut bodies) = (Vec::new(), Vec::new());
    for contact in &packed.contacts {
        match contact.partner {
            Partner::Grain(other) => pairs.push((contact.grain, other, history(contact))),
            Partner::Floor(k) => pairs.push((contact.grain, mobile + k, history(contact))),
            Partner::Body(body) => bodies.push((contact.grain, body as u16, history(contact))),
        }
    }
    ContactMemory::new(discs, &pairs, bodies.into_iter())
}
