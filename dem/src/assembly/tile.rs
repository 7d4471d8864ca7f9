//! Tiles: square parts of an assembly that are advanced in parallel, each with the pairs of its discs.
//!
//! A pair of discs in one tile is evaluated once. A pair across a border is evaluated by both tiles, in
//! the same order of its discs and so with the same bits, and each tile uses its side. No tile writes what
//! another one reads during a step, so results do not depend on the number of threads.

use serde::{Deserialize, Serialize};

use super::boundary::Body;
use crate::contact::ContactLaw;
use crate::disc::Disc;
use crate::integrate::damp;
use crate::real::Real;

/// Two discs that can touch before the next search, by their places in the tile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct Pair<R: Real> {
    /// The disc that comes first in the order of the assembly.
    pub i: u16,
    pub j: u16,
    pub contact: History<R>,
    /// Normal dashpot (kg/s).
    pub dashpot: R,
}

/// A disc and a rigid box that can touch before the next search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct BodyPair<R: Real> {
    pub disc: u16,
    pub body: u16,
    pub contact: History<R>,
    /// Normal dashpot (kg/s).
    pub dashpot: R,
}

/// What a contact remembers of the last step; zero while its discs do not touch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub(crate) struct History<R: Real> {
    /// Tangential spring force (N): positive acts on `j` counter-clockwise around `i`.
    pub tangential: R,
    /// Normal force (N) less that of the spring.
    pub viscous: R,
}

/// Discs `first..end` of the assembly, those of other tiles near them, and their pairs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct Tile<R: Real> {
    /// Column and row of the tile.
    pub place: [u32; 2],
    pub first: u32,
    pub end: u32,
    /// Discs of other tiles, which come after the own ones in the tile.
    pub ghosts: Vec<u32>,
    /// Pairs of own discs.
    pub inner: Vec<Pair<R>>,
    /// Pairs of an own disc and a ghost.
    pub outer: Vec<Pair<R>>,
    pub bodies: Vec<BodyPair<R>>,
    #[serde(skip)]
    pub work: Work<R>,
}

/// Buffers of a step.
#[derive(Clone, Debug, Default)]
pub(super) struct Work<R: Real> {
    /// Own discs, then ghosts.
    pub discs: Vec<Disc<R>>,
    /// Force (N) and torque (N m) on each.
    forces: Vec<[R; 4]>,
    touching: Vec<u32>,
    branch: Vec<[R; 2]>,
}

/// Buffers are no state.
impl<R: Real> PartialEq for Work<R> {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// What acts on all tiles in one step.
pub(super) struct Step<'a, R: Real> {
    pub law: ContactLaw<R>,
    /// Length of a unit of [`Real::Fraction`] (m).
    pub unit: R,
    pub gravity: [R; 2],
    /// Rate at which velocities decay (1/s), which preparation uses.
    pub drag: R,
    pub bodies: &'a [Body<R>],
}

/// Sums over a tile in one step. Losses are per `dt`, so they are powers (W).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TileSums<R: Real> {
    /// Largest speed (m/s); not finite if any velocity is not.
    pub fastest: R,
    /// Largest overlap over the smaller radius; infinite if a disc is inside a box.
    pub overlap: R,
    pub dashpots: R,
    /// Work of friction, with what the tangential springs have stored.
    pub friction: R,
    pub damping: R,
    pub boxes: R,
}

/// Contacts evaluated side by side, one per SIMD lane.
const LANES: usize = 8;

impl<R: Real> Tile<R> {
    /// Number of own discs.
    pub fn len(&self) -> usize {
        (self.end - self.first) as usize
    }

    /// Place in the assembly of a disc of this tile.
    pub fn place_of(&self, local: u16) -> usize {
        match usize::from(local).checked_sub(self.len()) {
            None => self.first as usize + usize::from(local),
            Some(ghost) => self.ghosts[ghost] as usize,
        }
    }

    /// Advances the own discs by one step, from the assembly's `discs` into `next`.
    pub fn advance(
        &mut self,
        step: &Step<'_, R>,
        discs: &[Disc<R>],
        next: &mut [Disc<R>],
    ) -> TileSums<R> {
        // The same arithmetic without fused operations: the same bits on every processor.
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2.
            return unsafe { self.advance_avx2(step, discs, next) };
        }
        self.advance_portable(step, discs, next)
    }

    /// [`Self::advance_portable`], compiled with 32-byte vectors.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn advance_avx2(
        &mut self,
        step: &Step<'_, R>,
        discs: &[Disc<R>],
        next: &mut [Disc<R>],
    ) -> TileSums<R> {
        self.advance_portable(step, discs, next)
    }

    #[inline(always)]
    fn advance_portable(
        &mut self,
        step: &Step<'_, R>,
        discs: &[Disc<R>],
        next: &mut [Disc<R>],
    ) -> TileSums<R> {
        let Self { inner, outer, bodies, work, ghosts, .. } = self;
        work.discs.clear();
        work.discs.extend_from_slice(&discs[self.first as usize..self.end as usize]);
        work.discs.extend(ghosts.iter().map(|&g| discs[g as usize]));
        work.forces.clear();
        work.forces.resize(work.discs.len(), [R::default(); 4]);
        let mut sums = TileSums::default();
        // Both tiles count a pair across their border.
        for (pairs, weight) in [(inner, 1.0), (outer, 0.5)] {
            let contacts = find_touching(pairs, work, step.unit);
            evaluate(pairs, contacts, work, &step.law, R::from_f64(weight), &mut sums);
        }
        evaluate_bodies(bodies, work, step, &mut sums);
        integrate(work, step, next, &mut sums);
        sums
    }
}

/// Lists the touching pairs with their branch vectors, without branching on whether a pair touches, and
/// ends the history of the others. Returns how many touch.
#[inline(always)]
fn find_touching<R: Real>(pairs: &mut [Pair<R>], work: &mut Work<R>, unit: R) -> usize {
    let Work { discs, touching, branch, .. } = work;
    // One more than can be used: the entry after the last touching pair is written speculatively.
    touching.resize(touching.len().max(pairs.len() + 1), 0);
    branch.resize(touching.len(), [R::default(); 2]);
    let keep = [R::default(), R::from_f64(1.0)];
    let mut contacts = 0;
    for (index, pair) in pairs.iter_mut().enumerate() {
        let (a, b) = (&discs[pair.i as usize], &discs[pair.j as usize]);
        let lx = unit * R::nearest(a.s[0], b.s[0]);
        let ly = unit * R::nearest(a.s[1], b.s[1]);
        let reach = a.r + b.r;
        let touches = usize::from(lx * lx + ly * ly < reach * reach);
        touching[contacts] = index as u32;
        branch[contacts] = [lx, ly];
        contacts += touches;
        pair.contact.tangential = pair.contact.tangential * keep[touches];
        pair.contact.viscous = pair.contact.viscous * keep[touches];
    }
    contacts
}

/// Contact law of the touching pairs, [`LANES`] at a time: gather, compute, scatter.
#[inline(always)]
fn evaluate<R: Real>(
    pairs: &mut [Pair<R>],
    contacts: usize,
    work: &mut Work<R>,
    law: &ContactLaw<R>,
    weight: R,
    sums: &mut TileSums<R>,
) {
    let (zero, half, one) = (R::default(), R::from_f64(0.5), R::from_f64(1.0));
    let compliance = half / (law.tangential_stiffness * law.dt);
    let Work { discs, forces, touching, branch } = work;
    let mut deepest = [zero; LANES];
    let (mut dashpots, mut friction) = ([zero; LANES], [zero; LANES]);

    let touching = touching[..contacts].chunks(LANES);
    for (chunk, branch) in touching.zip(branch[..contacts].chunks(LANES)) {
        // Lanes beyond the last contact hold two discs of radius 1/2 that just touch.
        let (mut lx, mut ly) = ([one; LANES], [zero; LANES]);
        let (mut ux, mut uy) = ([zero; LANES], [zero; LANES]);
        let (mut ri, mut rj) = ([half; LANES], [half; LANES]);
        let (mut wi, mut wj) = ([zero; LANES], [zero; LANES]);
        let (mut tangential, mut viscous) = ([zero; LANES], [zero; LANES]);
        let mut dashpot = [zero; LANES];
        for (k, &index) in chunk.iter().enumerate() {
            let pair = &pairs[index as usize];
            let (a, b) = (&discs[pair.i as usize], &discs[pair.j as usize]);
            [lx[k], ly[k]] = branch[k];
            ux[k] = b.u[0] - a.u[0];
            uy[k] = b.u[1] - a.u[1];
            (ri[k], rj[k]) = (a.r, b.r);
            (wi[k], wj[k]) = (a.w, b.w);
            (tangential[k], viscous[k]) = (pair.contact.tangential, pair.contact.viscous);
            dashpot[k] = pair.dashpot;
        }

        let (mut fx, mut fy) = ([zero; LANES], [zero; LANES]);
        let (mut torque_i, mut torque_j) = ([zero; LANES], [zero; LANES]);
        for k in 0..LANES {
            let length = (lx[k] * lx[k] + ly[k] * ly[k]).sqrt();
            let inverse = one / length;
            let (nx, ny) = (lx[k] * inverse, ly[k] * inverse);
            let overlap = ri[k] + rj[k] - length;
            let (arm_i, arm_j) = (ri[k] - half * overlap, rj[k] - half * overlap);
            let vn = ux[k] * nx + uy[k] * ny;
            let vt = uy[k] * nx - ux[k] * ny - arm_i * wi[k] - arm_j * wj[k];
            let [normal, ft] =
                law.forces(overlap, [vn, vt], dashpot[k], tangential[k], law.friction);

            // Power over the step by the mean of the forces at its two ends, less what the springs store.
            let dissipative = normal - law.normal_stiffness * overlap;
            dashpots[k] += half * (dissipative + viscous[k]) * vn;
            let sum = ft + tangential[k];
            friction[k] += sum * (half * vt + (ft - tangential[k]) * compliance);
            (tangential[k], viscous[k]) = (ft, dissipative);

            fx[k] = normal * nx - ft * ny;
            fy[k] = normal * ny + ft * nx;
            torque_i[k] = ft * arm_i;
            torque_j[k] = ft * arm_j;
            deepest[k] = deepest[k].max(overlap / ri[k].min(rj[k]));
        }

        for (k, &index) in chunk.iter().enumerate() {
            let pair = &mut pairs[index as usize];
            pair.contact = History { tangential: tangential[k], viscous: viscous[k] };
            let fi = &mut forces[pair.i as usize];
            fi[0] -= fx[k];
            fi[1] -= fy[k];
            fi[2] -= torque_i[k];
            let fj = &mut forces[pair.j as usize];
            fj[0] += fx[k];
            fj[1] += fy[k];
            fj[2] -= torque_j[k];
        }
    }
    for k in 0..LANES {
        sums.overlap = sums.overlap.max(deepest[k]);
        sums.dashpots += -(weight * dashpots[k]);
        sums.friction += -(weight * friction[k]);
    }
}

/// Contact law between discs and rigid boxes.
#[inline(always)]
fn evaluate_bodies<R: Real>(
    pairs: &mut [BodyPair<R>],
    work: &mut Work<R>,
    step: &Step<'_, R>,
    sums: &mut TileSums<R>,
) {
    let law = &step.law;
    let (zero, half) = (R::default(), R::from_f64(0.5));
    let compliance = half / (law.tangential_stiffness * law.dt);
    for pair in pairs {
        let disc = &work.discs[pair.disc as usize];
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
        let old = pair.contact;
        let friction = body.friction(branch);
        let [normal, ft] = law.forces(overlap, [vn, vt], pair.dashpot, old.tangential, friction);
        let dissipative = normal - law.normal_stiffness * overlap;
        sums.dashpots += -(half * (dissipative + old.viscous) * vn);
        let sum = ft + old.tangential;
        sums.friction += -(sum * (half * vt + (ft - old.tangential) * compliance));
        pair.contact = History { tangential: ft, viscous: dissipative };

        // Force of the disc on the box.
        let (fx, fy) = (normal * nx - ft * ny, normal * ny + ft * nx);
        sums.boxes += -(fx * body.velocity[0] + fy * body.velocity[1]);
        sums.overlap = sums.overlap.max(overlap / disc.r);
        let force = &mut work.forces[pair.disc as usize];
        force[0] -= fx;
        force[1] -= fy;
        force[2] -= ft * length;
    }
}

/// One step of symplectic Euler (leapfrog with velocities at half steps). Fixed discs stay.
#[inline(always)]
fn integrate<R: Real>(
    work: &Work<R>,
    step: &Step<'_, R>,
    next: &mut [Disc<R>],
    sums: &mut TileSums<R>,
) {
    let zero = R::default();
    let dt = step.law.dt;
    let per_unit = dt / step.unit;
    let alpha = step.law.local_damping;
    // Not only the maximum: comparisons drop NaN, a sum keeps it.
    let (mut fastest, mut sum) = (zero, zero);
    for ((old, force), new) in work.discs.iter().zip(&work.forces).zip(next) {
        *new = *old;
        if old.inv_mass == zero {
            continue;
        }
        let mass = R::from_f64(1.0) / old.inv_mass;
        let mut f = [force[0], force[1], force[2]];
        f[0] += mass * step.gravity[0];
        f[1] += mass * step.gravity[1];
        let mut lost = zero;
        if alpha != zero || step.drag != zero {
            let inertia = R::from_f64(1.0) / old.inv_inertia;
            let resistance = [mass, mass, inertia].map(|m| m * step.drag);
            for (k, velocity) in [old.u[0], old.u[1], old.w].into_iter().enumerate() {
                let resisting = f[k] - damp(f[k], velocity, alpha) + resistance[k] * velocity;
                f[k] -= resisting;
                lost += resisting * velocity;
            }
        }
        new.u[0] = old.u[0] + f[0] * (dt * old.inv_mass);
        new.u[1] = old.u[1] + f[1] * (dt * old.inv_mass);
        new.w = old.w + f[2] * (dt * old.inv_inertia);
        new.s[0] = R::advance(old.s[0], per_unit * new.u[0]);
        new.s[1] = R::advance(old.s[1], per_unit * new.u[1]);
        let speed2 = new.u[0] * new.u[0] + new.u[1] * new.u[1];
        fastest = fastest.max(speed2);
        sum += speed2 + new.w * new.w;
        sums.damping += lost;
    }
    let finite = sum.to_f64().is_finite();
    sums.fastest = if finite { fastest.sqrt() } else { R::from_f64(f64::NAN) };
}
