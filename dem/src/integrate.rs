//! One leapfrog step of the SLLOD equations in the deforming cell.

use nalgebra::Matrix2;

use crate::contact::{ContactLaw, Force};
use crate::packing::Packing;
use crate::real::Real;

/// Advances velocities by the forces, the cell by `increment = exp(L dt)`, and positions.
///
/// `du/dt = F/m - L u`, `dx/dt = u + L x`; Cundall damping acts on `u` and on the spin relative
/// to the cell. In reduced coordinates `x' = increment x + u dt` is `s' = s + h'^-1 u dt`.
/// Returns the largest peculiar speed (m/s), not finite if anything is not.
pub fn integrate<R: Real>(
    packing: &mut Packing<R>,
    law: &ContactLaw<R>,
    velocity_gradient: &Matrix2<f64>,
    increment: &Matrix2<f64>,
    force: &[Force<R>],
) -> f64 {
    packing.cell.h = increment * packing.cell.h;
    let Some(inverse) = packing.cell.inverse() else {
        return f64::NAN;
    };
    let to_units = (inverse * (law.dt.to_f64() / R::UNIT)).map(R::from_f64);
    let ldt = (velocity_gradient * law.dt.to_f64()).map(R::from_f64);
    let spin = R::from_f64(packing.spin);
    let zero = R::default();
    let damped = law.local_damping != zero;
    let mut fastest = zero;
    // Not only the maximum: comparisons drop NaN, a sum keeps it.
    let mut sum = zero;

    for (d, f) in packing.discs.iter_mut().zip(force) {
        let [mut fx, mut fy, mut torque, _] = *f;
        let [ux, uy] = d.u;
        if damped {
            fx = damp(fx, ux, law.local_damping);
            fy = damp(fy, uy, law.local_damping);
            torque = damp(torque, d.w - spin, law.local_damping);
        }
        let kick = law.dt * d.inv_mass;
        let vx = ux + fx * kick - (ldt[(0, 0)] * ux + ldt[(0, 1)] * uy);
        let vy = uy + fy * kick - (ldt[(1, 0)] * ux + ldt[(1, 1)] * uy);
        d.u = [vx, vy];
        d.w += torque * (law.dt * d.inv_inertia);
        d.s[0] = R::advance(d.s[0], to_units[(0, 0)] * vx + to_units[(0, 1)] * vy);
        d.s[1] = R::advance(d.s[1], to_units[(1, 0)] * vx + to_units[(1, 1)] * vy);
        let speed2 = vx * vx + vy * vy;
        fastest = fastest.max(speed2);
        sum += speed2 + d.w * d.w;
    }
    let fastest = fastest.sqrt().to_f64();
    if sum.to_f64().is_finite() { fastest } else { f64::NAN }
}

/// Cundall local damping: a force that speeds a disc up is reduced by `alpha`, one that slows it
/// down is raised by `alpha`.
#[inline(always)]
fn damp<R: Real>(force: R, velocity: R, alpha: R) -> R {
    let power = force * velocity;
    if power > R::default() {
        force - alpha * force
    } else if power < R::default() {
        force + alpha * force
    } else {
        force
    }
}
