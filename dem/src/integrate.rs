//! One leapfrog step of the SLLOD equations in the deforming cell.

use nalgebra::Matrix2;

use crate::contact::{ContactLaw, Force};
use crate::packing::Packing;
use crate::real::Real;

/// Advances velocities by the forces, the cell by `increment` $= \exp(\mathbf L \Delta t)$, and
/// positions, by the SLLOD equations (Evans & Morriss 1984, Phys. Rev. A 30, 1528) of the peculiar velocity
/// $\mathbf u$:
///
/// $$ \dot{\mathbf u} = \mathbf F / m - \mathbf L \mathbf u, \qquad
/// \dot{\mathbf x} = \mathbf u + \mathbf L \mathbf x. $$
///
/// Local damping acts on $\mathbf u$ and on the spin relative to the cell. In reduced coordinates the
/// position advances by $\mathbf h^{-1} \mathbf u \Delta t$ with the new cell $\mathbf h$.
/// Returns the largest peculiar speed (m/s), which is not finite if any velocity is not.
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

/// Local damping (Cundall 1987): a force that speeds a disc up is reduced by the fraction `alpha`, one that slows it
/// down is raised by it.
#[inline(always)]
pub(crate) fn damp<R: Real>(force: R, velocity: R, alpha: R) -> R {
    let power = force * velocity;
    if power > R::default() {
        force - alpha * force
    } else if power < R::default() {
        force + alpha * force
    } else {
        force
    }
}
