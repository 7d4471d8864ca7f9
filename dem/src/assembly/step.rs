//! What acts on all tiles in one step, and what each reports.

use super::boundary::Body;
use super::pairs::{Rolling, Sliding};
use crate::contact::ContactLaw;
use crate::real::Real;

/// Pairs or discs treated side by side, one per SIMD lane.
pub(super) const LANES: usize = 8;

/// What acts on all tiles in one step.
pub(super) struct Step<'a, R: Real> {
    pub law: ContactLaw<R>,
    /// Length of a unit of [`Real::Fraction`] (m).
    pub unit: R,
    pub gravity: [R; 2],
    /// Rate at which velocities decay (1/s), which preparation uses.
    pub drag: R,
    pub bodies: &'a [Body<R>],
    /// Part of what presses on a held disc by which the force on it may change; see [`Sleep`](super::Sleep).
    pub tolerance: R,
}

/// Sums over a tile in one step. Losses are per `dt`, so they are powers (W).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TileSums<R: Real> {
    /// Largest speed (m/s); not finite if any velocity is not.
    pub fastest: R,
    /// Largest overlap over the smaller radius; infinite if a disc is inside a box.
    pub overlap: R,
    pub dashpots: R,
    /// Work of friction and of rolling resistance, with what their springs have stored.
    pub friction: R,
    pub damping: R,
    pub boxes: R,
    /// Discs that were left out, as nothing around them moved.
    pub skipped: u32,
}

/// Power (W) of the dashpot and of sliding over a step, by the mean of the forces at its two ends, less what
/// the tangential spring, of `compliance` $1 / (2 k_t \Delta t)$, stores. Both take energy where they are negative.
/// A contact that `opens` is not seen again: its dashpot acts until the end of the step.
#[inline(always)]
pub(super) fn power<R: Real>(
    [old, new]: [Sliding<R>; 2],
    [vn, vt]: [R; 2],
    compliance: R,
    opens: bool,
) -> [R; 2] {
    let half = R::from_f64(0.5);
    let last = if opens { half * new.viscous } else { R::default() };
    let dashpot = (half * (new.viscous + old.viscous) + last) * vn;
    let sum = new.tangential + old.tangential;
    let sliding = sum * (half * vt + (new.tangential - old.tangential) * compliance);
    [dashpot, sliding]
}

/// Power (W) of rolling at a velocity `vr` (m/s) in the same way; the rolling spring has a `compliance`
/// $1 / (2 k_r \Delta t)$.
#[inline(always)]
pub(super) fn rolling_power<R: Real>([old, new]: [Rolling<R>; 2], vr: R, compliance: R) -> R {
    let half = R::from_f64(0.5);
    let spring = new.spring + old.spring;
    let stored = spring * (new.spring - old.spring) * compliance;
    half * (spring + new.viscous + old.viscous) * vr + stored
}
