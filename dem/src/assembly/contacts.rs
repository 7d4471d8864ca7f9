//! The contact law between discs, [`LANES`] contacts at a time.

use multiversion::multiversion;

use super::pairs::{BLOCK, Pairs, Rolling, Sliding};
use super::step::{LANES, Step, TileSums, power, rolling_power};
use super::touching::Touching;
use crate::disc::Disc;
use crate::real::Real;

/// Adds the forces of touching pairs to those on the discs of a tile, which begins at `first`, and advances
/// their histories. Of pairs that are not `INNER`, another tile has the second disc. Contacts may resist `ROLLING`.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn evaluate<R: Real, const INNER: bool, const ROLLING: bool>(
    pairs: &mut Pairs<R>,
    touching: &[Touching],
    discs: &[Disc<R>],
    first: u32,
    forces: &mut [[R; 4]],
    step: &Step<'_, R>,
    sums: &mut TileSums<R>,
) {
    let mut batch = Batch::default();
    // Apart from the batch: where nothing resists rolling nobody touches it.
    let mut rolling = [Rolling::default(); BLOCK];
    let mut lanes = LaneSums::default();
    for touching in touching.chunks(BLOCK) {
        batch.gather(touching, pairs, discs, step.unit);
        if ROLLING {
            gather_rolling(touching, pairs, &mut rolling);
        }
        batch.evaluate::<ROLLING>(touching.len(), step, &mut rolling, &mut lanes);
        for (k, pair) in touching.iter().enumerate() {
            pairs.sliding[pair.index()] =
                Sliding { tangential: batch.tangential[k], viscous: batch.viscous[k] };
            if ROLLING {
                pairs.rolling[pair.index()] = rolling[k];
            }
            let [i, j] = pair.discs.map(|place| (place - first) as usize);
            forces[i] = [0, 1, 2, 3].map(|c| forces[i][c] - batch.on_i[k][c]);
            if INNER {
                forces[j] = [0, 1, 2, 3].map(|c| forces[j][c] + batch.on_j[k][c]);
            }
        }
    }
    // Both tiles count a pair across their border.
    let weight = R::from_f64(if INNER { 1.0 } else { 0.5 });
    for k in 0..LANES {
        sums.overlap = sums.overlap.max(lanes.deepest[k]);
        sums.dashpots += -(weight * lanes.dashpots[k]);
        sums.friction += -(weight * lanes.friction[k]);
    }
}

/// Sums over the contacts of each lane.
#[derive(Clone, Copy, Default)]
struct LaneSums<R: Real> {
    /// Largest overlap over the smaller radius.
    deepest: [R; LANES],
    /// Power (W).
    dashpots: [R; LANES],
    friction: [R; LANES],
}

/// A block of contacts, quantity by quantity, of the first disc `i` and the second disc `j`.
struct Batch<R: Real> {
    /// From `i` to `j`, in units of [`Real::Fraction`].
    separation: [[R; 2]; BLOCK],
    /// Velocity of `j` relative to `i` (m/s).
    ux: [R; BLOCK],
    uy: [R; BLOCK],
    /// Angular velocities (1/s) and radii (m).
    wi: [R; BLOCK],
    wj: [R; BLOCK],
    ri: [R; BLOCK],
    rj: [R; BLOCK],
    tangential: [R; BLOCK],
    viscous: [R; BLOCK],
    dashpot: [R; BLOCK],
    /// Inverse of the effective mass (1/kg).
    inv_mass: [R; BLOCK],
    /// What the contact takes from force and torque on `i`, and adds to those on `j`.
    on_i: [[R; 4]; BLOCK],
    on_j: [[R; 4]; BLOCK],
}

impl<R: Real> Default for Batch<R> {
    fn default() -> Self {
        let zero = R::default();
        let [a, b, c] = [[zero; BLOCK]; 3];
        Self {
            separation: [[zero; 2]; BLOCK],
            ux: a,
            uy: a,
            wi: a,
            wj: a,
            ri: b,
            rj: b,
            tangential: c,
            viscous: c,
            dashpot: c,
            inv_mass: c,
            on_i: [[zero; 4]; BLOCK],
            on_j: [[zero; 4]; BLOCK],
        }
    }
}

impl<R: Real> Batch<R> {
    /// Collects what the law needs of at most [`BLOCK`] pairs.
    #[inline(always)]
    fn gather(&mut self, touching: &[Touching], pairs: &Pairs<R>, discs: &[Disc<R>], unit: R) {
        let count = touching.len();
        assert!(count <= BLOCK);
        for (k, pair) in touching.iter().enumerate() {
            let [i, j] = pair.discs;
            let (a, b) = (&discs[i as usize], &discs[j as usize]);
            self.separation[k] = [R::nearest(a.s[0], b.s[0]), R::nearest(a.s[1], b.s[1])];
            self.ux[k] = b.u[0] - a.u[0];
            self.uy[k] = b.u[1] - a.u[1];
            (self.wi[k], self.wj[k]) = (a.w, b.w);
            (self.ri[k], self.rj[k]) = (a.r, b.r);
            let index = pair.index();
            let contact = if pair.before() { pairs.sliding[index] } else { Sliding::default() };
            (self.tangential[k], self.viscous[k]) = (contact.tangential, contact.viscous);
            self.dashpot[k] = pairs.dashpot[index];
            self.inv_mass[k] = a.inv_mass + b.inv_mass;
        }
        // Lanes beyond the last contact hold two discs at rest that just touch, one unit apart.
        let (zero, half) = (R::default(), R::from_f64(0.5));
        for k in count..count.next_multiple_of(LANES) {
            self.separation[k] = [half + half, zero];
            (self.ux[k], self.uy[k], self.wi[k], self.wj[k]) = (zero, zero, zero, zero);
            (self.ri[k], self.rj[k]) = (half * unit, half * unit);
            (self.tangential[k], self.viscous[k]) = (zero, zero);
            (self.dashpot[k], self.inv_mass[k]) = (zero, zero);
        }
    }

    /// The law for the first `count` contacts.
    #[inline(always)]
    fn evaluate<const ROLLING: bool>(
        &mut self,
        count: usize,
        step: &Step<'_, R>,
        rolling_of: &mut [Rolling<R>; BLOCK],
        sums: &mut LaneSums<R>,
    ) {
        let law = &step.law;
        let (zero, half, one) = (R::default(), R::from_f64(0.5), R::from_f64(1.0));
        let compliance = half / (law.tangential_stiffness * law.dt);
        let rolling_compliance = half / (law.rolling_stiffness * law.dt);
        let rolling_dashpot = if ROLLING { law.rolling_dashpot() } else { zero };
        let LaneSums { mut deepest, mut dashpots, mut friction } = *sums;
        for chunk in 0..count.div_ceil(LANES) {
            // Copies: the compiler then knows that nothing else writes them.
            let separation = chunk_of(&self.separation, chunk);
            let (ux, uy) = (chunk_of(&self.ux, chunk), chunk_of(&self.uy, chunk));
            let (wi, wj) = (chunk_of(&self.wi, chunk), chunk_of(&self.wj, chunk));
            let (ri, rj) = (chunk_of(&self.ri, chunk), chunk_of(&self.rj, chunk));
            let mut tangential = chunk_of(&self.tangential, chunk);
            let mut viscous = chunk_of(&self.viscous, chunk);
            let dashpot = chunk_of(&self.dashpot, chunk);
            let inv_mass = chunk_of(&self.inv_mass, chunk);
            let mut rolling = chunk_of(rolling_of, chunk);
            let (mut on_i, mut on_j) = ([[zero; 4]; LANES], [[zero; 4]; LANES]);
            let (mut lx, mut ly) = ([zero; LANES], [zero; LANES]);
            for k in 0..LANES {
                lx[k] = step.unit * separation[k][0];
                ly[k] = step.unit * separation[k][1];
            }
            for k in 0..LANES {
                let length = (lx[k] * lx[k] + ly[k] * ly[k]).sqrt();
                let inverse = one / length;
                let (nx, ny) = (lx[k] * inverse, ly[k] * inverse);
                let overlap = ri[k] + rj[k] - length;
                let (arm_i, arm_j) = (ri[k] - half * overlap, rj[k] - half * overlap);
                let vn = ux[k] * nx + uy[k] * ny;
                let vt = (uy[k] * nx - ux[k] * ny) - (arm_i * wi[k] + arm_j * wj[k]);
                let (mean, opens) = law.mean_overlap(overlap, vn, dashpot[k], inv_mass[k]);
                let [normal, ft] =
                    law.forces(mean, [vn, vt], dashpot[k], tangential[k], law.friction);

                let viscous_force = normal - law.normal_stiffness * mean;
                let new = Sliding { tangential: ft, viscous: viscous_force };
                let old = Sliding { tangential: tangential[k], viscous: viscous[k] };
                let [of_dashpot, of_sliding] = power([old, new], [vn, vt], compliance, opens);
                dashpots[k] += of_dashpot;
                friction[k] += of_sliding;
                (tangential[k], viscous[k]) = (new.tangential, new.viscous);
                deepest[k] = deepest[k].max(overlap / ri[k].min(rj[k]));

                let (fx, fy) = (normal * nx - ft * ny, normal * ny + ft * nx);
                on_i[k] = [fx, fy, ft * arm_i, -normal];
                on_j[k] = [fx, fy, -(ft * arm_j), normal];
                if ROLLING {
                    let radius = ri[k] * rj[k] / (ri[k] + rj[k]);
                    let vr = radius * (wj[k] - wi[k]);
                    let dashpot = rolling_dashpot * dashpot[k];
                    let old = rolling[k];
                    let [spring, total] = law.rolling_forces(vr, dashpot, old.spring, normal);
                    rolling[k] = Rolling { spring, viscous: total - spring };
                    friction[k] += rolling_power([old, rolling[k]], vr, rolling_compliance);
                    on_i[k][2] += radius * total;
                    on_j[k][2] += radius * total;
                }
            }
            self.tangential.as_chunks_mut().0[chunk] = tangential;
            self.viscous.as_chunks_mut().0[chunk] = viscous;
            if ROLLING {
                rolling_of.as_chunks_mut().0[chunk] = rolling;
            }
            self.on_i.as_chunks_mut().0[chunk] = on_i;
            self.on_j.as_chunks_mut().0[chunk] = on_j;
        }
        *sums = LaneSums { deepest, dashpots, friction };
    }
}

/// What touching pairs remember of rolling; zero beyond the last of a chunk of lanes.
#[inline(always)]
fn gather_rolling<R: Real>(
    touching: &[Touching],
    pairs: &Pairs<R>,
    rolling: &mut [Rolling<R>; BLOCK],
) {
    *rolling = [Rolling::default(); BLOCK];
    for (rolling, pair) in rolling.iter_mut().zip(touching).filter(|(_, pair)| pair.before()) {
        *rolling = pairs.rolling[pair.index()];
    }
}

/// The values of one chunk of lanes.
#[inline(always)]
fn chunk_of<T: Copy>(values: &[T; BLOCK], chunk: usize) -> [T; LANES] {
    values.as_chunks().0[chunk]
}
