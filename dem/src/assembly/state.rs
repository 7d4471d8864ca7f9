//! The state of a whole scene of discs.

use serde::{Deserialize, Serialize};

use super::boundary::{Body, RigidBox};
use super::coordinates::Region;
use super::energy::Losses;
use super::sleep::{Rest, Sleep};
use super::tile::Tile;
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
    pub(super) travel: f64,
    /// Searches since the start.
    pub(crate) searches: u64,
    pub(crate) losses: Losses,
    /// Largest overlap over the smaller radius since the start.
    pub(crate) max_overlap: f64,
    /// When grains that rest are held, and what is known of the rest of each; empty where none are.
    pub(crate) sleep: Option<Sleep>,
    pub(crate) rest: Vec<Rest<R>>,
    /// See [`Self::skipped`] and [`Self::audit`].
    pub(crate) skipped: u64,
    pub(crate) audit: f64,
    #[serde(skip)]
    pub(super) next: Buffer<R>,
}

/// The discs of the next step, and of the last one after it. No part of the state.
#[derive(Clone, Debug, Default)]
pub(super) struct Buffer<R: Real>(pub Vec<Disc<R>>);

impl<R: Real> PartialEq for Buffer<R> {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl<R: Real> Assembly<R> {
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
}
