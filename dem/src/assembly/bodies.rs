//! Contacts of discs with rigid boxes.

use super::pairs::{BodyPair, History, Rolling, Sliding};
use super::step::{Step, TileSums, power, rolling_power};
use crate::disc::Disc;
use crate::real::Real;

/// Contact law between discs and rigid boxes.
pub(super) fn evaluate_bodies<R: Real>(
    pairs: &mut [BodyPair<R>],
    discs: &[Disc<R>],
    first: u32,
    forces: &mut [[R; 4]],
    step: &Step<'_, R>,
    sums: &mut TileSums<R>,
) {
    let law = &step.law;
    let (zero, half) = (R::default(), R::from_f64(0.5));
    let compliance = half / (law.tangential_stiffness * law.dt);
    let rolling_compliance = half / (law.rolling_stiffness * law.dt);
    for pair in pairs {
        let disc = &discs[pair.disc as usize];
        let body = &step.bodies[pair.body as usize];
        let branch = body.branch(disc.s);
        let [lx, ly] = branch.map(|l| step.unit * l);
        let distance2 = lx * lx + ly * ly;
        if distance2 >= disc.r * disc.r {
            pair.contact = History::default();
            continue;
        }
        if distance2 == zero {
            sums.overlap = R::from_f64(f64::INFINITY);
            return;
        }
        let length = distance2.sqrt();
        let (nx, ny) = (lx / length, ly / length);
        let overlap = disc.r - length;
        let [ux, uy] = [body.velocity[0] - disc.u[0], body.velocity[1] - disc.u[1]];
        let vn = ux * nx + uy * ny;
        let vt = uy * nx - ux * ny - length * disc.w;
        let History { sliding: old, rolling: old_rolling } = pair.contact;
        let friction = body.friction(branch);
        let (mean, opens) = law.mean_overlap(overlap, vn, pair.dashpot, disc.inv_mass);
        let [normal, ft] = law.forces(mean, [vn, vt], pair.dashpot, old.tangential, friction);
        let new = Sliding { tangential: ft, viscous: normal - law.normal_stiffness * mean };
        let [of_dashpot, of_sliding] = power([old, new], [vn, vt], compliance, opens);
        sums.dashpots += -of_dashpot;
        sums.friction += -of_sliding;
        let mut rolling = Rolling::default();
        if law.resists_rolling() {
            // A disc on a plane has a reduced radius of its own.
            let vr = -(disc.r * disc.w);
            let dashpot = law.rolling_dashpot() * pair.dashpot;
            let [spring, total] = law.rolling_forces(vr, dashpot, old_rolling.spring, normal);
            rolling = Rolling { spring, viscous: total - spring };
            sums.friction += -rolling_power([old_rolling, rolling], vr, rolling_compliance);
            forces[(pair.disc - first) as usize][2] -= disc.r * total;
        }
        pair.contact = History { sliding: new, rolling };

        // Force of the disc on the box.
        let (fx, fy) = (normal * nx - ft * ny, normal * ny + ft * nx);
        sums.boxes += -(fx * body.velocity[0] + fy * body.velocity[1]);
        sums.overlap = sums.overlap.max(overlap / disc.r);
        let force = &mut forces[(pair.disc - first) as usize];
        force[0] -= fx;
        force[1] -= fy;
        force[2] -= ft * length;
        force[3] += normal;
    }
}
