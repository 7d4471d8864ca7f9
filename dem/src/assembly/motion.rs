//! Motion of discs under the forces on them.

use multiversion::multiversion;

use super::sleep::Rest;
use super::step::{LANES, Step, TileSums};
use crate::disc::Disc;
use crate::integrate::damp;
use crate::real::Real;

/// Takes what local damping and drag resist with from the forces.
pub(super) fn resist<R: Real>(
    own: &[Disc<R>],
    forces: &mut [[R; 4]],
    step: &Step<'_, R>,
    sums: &mut TileSums<R>,
) {
    let (zero, one) = (R::default(), R::from_f64(1.0));
    let alpha = step.law.local_damping;
    for (disc, force) in own.iter().zip(forces) {
        if disc.inv_mass == zero {
            continue;
        }
        let (mass, inertia) = (one / disc.inv_mass, one / disc.inv_inertia);
        let weight = [mass * step.gravity[0], mass * step.gravity[1], zero];
        let inertias = [mass, mass, inertia];
        for (k, velocity) in [disc.u[0], disc.u[1], disc.w].into_iter().enumerate() {
            let mut resisting = step.drag * inertias[k] * velocity;
            if alpha != zero {
                let total = force[k] + weight[k];
                resisting += total - damp(total, velocity, alpha);
            }
            force[k] -= resisting;
            sums.damping += resisting * velocity;
        }
    }
}

/// Leaves discs that sleep where they are, and lets them feel the forces on them.
pub(super) fn hold<R: Real>(
    own: &[Disc<R>],
    forces: &[[R; 4]],
    step: &Step<'_, R>,
    rest: &mut [Rest<R>],
    next: &mut [Disc<R>],
) {
    let [gx, gy] = step.gravity;
    let gravity = (gx * gx + gy * gy).sqrt();
    for (((disc, force), rest), next) in own.iter().zip(forces).zip(rest).zip(next) {
        if rest.state.is_held() {
            *next = *disc;
        }
        if rest.state.is_held() && !rest.quiet {
            let weight = gravity / disc.inv_mass;
            let felt = [force[0], force[1], force[2] / disc.r];
            rest.feel(felt, force[3] + weight, step.tolerance);
        }
    }
}

/// Discs whose positions advance side by side.
const BLOCK: usize = 32;

/// One step of symplectic Euler (leapfrog with velocities at half steps). Fixed discs stay.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn integrate<R: Real>(
    own: &[Disc<R>],
    forces: &[[R; 4]],
    step: &Step<'_, R>,
    next: &mut [Disc<R>],
    sums: &mut TileSums<R>,
) {
    let zero = R::default();
    let dt = step.law.dt;
    let per_unit = dt / step.unit;
    let falls = [dt * step.gravity[0], dt * step.gravity[1]];
    let mut positions = [R::Fraction::default(); 2 * BLOCK];
    let mut moves = [zero; 2 * BLOCK];
    let (mut speed2, mut spin2) = ([zero; BLOCK], [zero; BLOCK]);
    // Not only the maximum: comparisons drop NaN, a sum keeps it.
    let (mut fastest, mut sum) = ([zero; LANES], [zero; LANES]);
    let blocks = own.chunks(BLOCK).zip(forces.chunks(BLOCK)).zip(next.chunks_mut(BLOCK));
    for ((own, forces), next) in blocks {
        let targets = positions
            .as_chunks_mut::<2>()
            .0
            .iter_mut()
            .zip(moves.as_chunks_mut::<2>().0)
            .zip(&mut speed2)
            .zip(&mut spin2);
        for (((old, force), new), (((position, moves), speed2), spin2)) in
            own.iter().zip(forces).zip(&mut *next).zip(targets)
        {
            let [gx, gy] = if old.inv_mass > zero { falls } else { [zero; 2] };
            let kick = dt * old.inv_mass;
            let ux = old.u[0] + (force[0] * kick + gx);
            let uy = old.u[1] + (force[1] * kick + gy);
            let w = old.w + force[2] * (dt * old.inv_inertia);
            *new = Disc { u: [ux, uy], w, ..*old };
            *position = old.s;
            *moves = [per_unit * ux, per_unit * uy];
            *speed2 = ux * ux + uy * uy;
            *spin2 = w * w;
        }
        for (s, &step) in positions.iter_mut().zip(&moves) {
            *s = R::advance(*s, step);
        }
        for (new, &s) in next.iter_mut().zip(positions.as_chunks::<2>().0) {
            new.s = s;
        }
        let lanes = speed2[..own.len()].chunks(LANES).zip(spin2.chunks(LANES));
        for (speed2, spin2) in lanes {
            for (k, (&speed2, &spin2)) in speed2.iter().zip(spin2).enumerate() {
                fastest[k] = fastest[k].max(speed2);
                sum[k] += speed2 + spin2;
            }
        }
    }
    let fastest = fastest.into_iter().fold(zero, R::max);
    let finite = sum.iter().all(|sum| sum.to_f64().is_finite());
    sums.fastest = if finite { fastest.sqrt() } else { R::from_f64(f64::NAN) };
}
