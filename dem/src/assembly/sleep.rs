//! Grains at rest that hold their places.
//!
//! A grain that has stayed within a small distance for some time is held: its velocity is zero and it does not
//! move. Its contacts stay, with their overlaps and springs, so that weight is carried and nothing creeps. It
//! wakes as soon as the force on it has changed by more than a part of what presses on it. Where a grain and all around it
//! are held no force changes, and nothing is computed.

use serde::{Deserialize, Serialize};

use crate::disc::Disc;
use crate::grains::Grains;
use crate::real::Real;

/// Steps between two looks at which grains rest.
pub(crate) const LOOK: u64 = 16;

/// When grains at rest are held, and when they are woken.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sleep {
    /// A grain that stays within this distance (m) of a place
    pub distance: f64,
    /// for this time (s) is held there.
    pub time: f64,
    /// It is not held while it is faster (m/s), or its rim.
    pub speed: f64,
    /// A change of the force on it by this part of the sum of its normal forces and its weight wakes it.
    pub force: f64,
    /// Part of the places whose grains are never held, to see how far they would move.
    pub audit: f64,
    /// Edge of these places (m).
    pub patch: f64,
    /// Seed of their choice.
    pub seed: u32,
}

/// [`Sleep`] of default grains: distance over diameter, time over $\sqrt{d / g}$, speed over $\sqrt{g d}$.
const DISTANCE: f64 = 0.02;
const TIME: f64 = 2.0;
const SPEED: f64 = 0.1;
/// Less than what one of four or five equal contacts carries: a grain that loses a support wakes.
const FORCE: f64 = 0.1;
/// Part of the grains that is audited, and edge of their places over the diameter.
const AUDIT: f64 = 0.01;
const PATCH: f64 = 4.0;

impl Sleep {
    /// For grains under `gravity` (m/s²), with places for the audit chosen by `seed`; none without gravity, as nothing
    /// comes to rest.
    pub fn of(grains: &Grains, gravity: [f64; 2], seed: u32) -> Option<Self> {
        let gravity = gravity[0].hypot(gravity[1]);
        let diameter = grains.mean_diameter();
        (gravity > 0.0).then(|| Self {
            distance: DISTANCE * diameter,
            time: TIME * (diameter / gravity).sqrt(),
            speed: SPEED * (diameter * gravity).sqrt(),
            force: FORCE,
            audit: AUDIT,
            patch: PATCH * diameter,
            seed,
        })
    }

    /// Looks, in steps of `dt` (s), after which a grain is held.
    pub(crate) fn looks(&self, dt: f64) -> u32 {
        (self.time / (dt * LOOK as f64)).ceil().max(1.0) as u32
    }

    /// Patches along the `side` (m) of a region.
    pub(crate) fn patches(&self, side: f64) -> usize {
        (side / self.patch).ceil().max(1.0) as usize
    }

    /// Hashes below this are audited.
    pub(crate) fn audited(&self) -> u32 {
        (self.audit.clamp(0.0, 1.0) * f64::from(u32::MAX)) as u32
    }
}

/// Whether a grain is held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum State {
    #[default]
    Awake,
    /// Held since the last look.
    Drowsy,
    /// Held for longer: its springs have found their forces.
    Asleep,
    /// Would be held, but is computed for the audit.
    Watched,
}

/// What is known of the rest of a grain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub(crate) struct Rest<R: Real> {
    pub state: State,
    /// The place that it stays near; of one that is watched, where it was when something around it moved last.
    pub place: [R::Fraction; 2],
    /// Looks since it is near.
    pub looks: u32,
    /// Force (N) and torque over radius (N) on it, as it was held first.
    pub force: [R; 3],
    /// Change of them (N) that wakes it; negative before they are known.
    pub allowed: R,
    /// Whether it is to wake, or what is around it moves.
    pub disturbed: bool,
    /// Whether all that it can feel stays as it is: nothing of it is computed.
    pub quiet: bool,
}

/// What a look compares with.
pub(super) struct Look<R: Real> {
    /// Length of a unit of [`Real::Fraction`] (m).
    pub unit: R,
    pub distance: R,
    pub speed: R,
    pub looks: u32,
    pub patches: usize,
    pub audited: u32,
    pub seed: u32,
}

impl<R: Real> Look<R> {
    fn is_slow(&self, disc: &Disc<R>) -> bool {
        let rim = disc.r * disc.w;
        disc.u[0] * disc.u[0] + disc.u[1] * disc.u[1] + rim * rim <= self.speed * self.speed
    }
}

impl State {
    /// Whether the grain holds its place.
    pub fn is_held(self) -> bool {
        matches!(self, Self::Drowsy | Self::Asleep)
    }
}

impl<R: Real> Rest<R> {
    /// Takes a look at a grain. Returns the kinetic energy (J) that it loses as it is held.
    pub(super) fn look(&mut self, look: &Look<R>, disc: &mut Disc<R>) -> f64 {
        match self.state {
            State::Drowsy | State::Asleep if !self.disturbed => self.state = State::Asleep,
            State::Watched if look.is_slow(disc) => {
                if self.disturbed {
                    self.place = disc.s;
                }
            }
            State::Awake if self.is_near(look, disc) => {
                self.looks += 1;
                if self.looks >= look.looks {
                    return self.hold(look, disc);
                }
            }
            _ => (self.state, self.place, self.looks) = (State::Awake, disc.s, 0),
        }
        self.disturbed = false;
        0.0
    }

    /// Whether a grain is where it was, and slow.
    fn is_near(&self, look: &Look<R>, disc: &Disc<R>) -> bool {
        let [x, y] = self.moved(look.unit, disc);
        x * x + y * y <= look.distance * look.distance && look.is_slow(disc)
    }

    /// Displacement from its place (m).
    pub fn moved(&self, unit: R, disc: &Disc<R>) -> [R; 2] {
        [0, 1].map(|k| unit * R::nearest(self.place[k], disc.s[k]))
    }

    fn hold(&mut self, look: &Look<R>, disc: &mut Disc<R>) -> f64 {
        self.place = disc.s;
        self.disturbed = false;
        let [x, y] = disc.s.map(|s| R::bin(s, look.patches) as u32);
        if hash(look.seed, x, y) < look.audited {
            self.state = State::Watched;
            return 0.0;
        }
        let [u, v, w] = [disc.u[0], disc.u[1], disc.w].map(R::to_f64);
        let energy = 0.5 * (u * u + v * v) / disc.inv_mass.to_f64()
            + 0.5 * w * w / disc.inv_inertia.to_f64();
        (self.state, self.allowed) = (State::Drowsy, R::from_f64(-1.0));
        (disc.u, disc.w) = ([R::default(); 2], R::default());
        energy
    }

    /// Compares the force on a grain that is held with that when it was held first. `pressing` is the sum of its
    /// normal forces and its weight (N), of which a part `tolerance` is allowed.
    pub fn feel(&mut self, force: [R; 3], pressing: R, tolerance: R) {
        if self.allowed < R::default() {
            (self.force, self.allowed) = (force, tolerance * pressing);
        }
        let [x, y, t] = [0, 1, 2].map(|k| force[k] - self.force[k]);
        self.disturbed |= x * x + y * y + t * t > self.allowed * self.allowed;
    }
}

/// A number that looks random, the same on a GPU.
fn hash(seed: u32, x: u32, y: u32) -> u32 {
    let mut h = seed ^ x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77);
    h = (h ^ h >> 16).wrapping_mul(0x7feb_352d);
    h = (h ^ h >> 15).wrapping_mul(0x846c_a68b);
    h ^ h >> 16
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five contacts of 1 N around a grain without weight: without one of them 1 N is left over.
    #[test]
    fn a_grain_that_loses_one_of_five_equal_contacts_wakes() {
        let mut rest = Rest::<f64> { state: State::Asleep, allowed: -1.0, ..Rest::default() };
        rest.feel([0.0; 3], 5.0, FORCE);
        assert!(!rest.disturbed);
        rest.feel([0.2, 0.0, 0.0], 5.0, FORCE);
        assert!(!rest.disturbed, "a fifth of a contact is noise");
        rest.feel([1.0, 0.0, 0.0], 4.0, FORCE);
        assert!(rest.disturbed);
    }
}
