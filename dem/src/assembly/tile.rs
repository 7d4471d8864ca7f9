//! Tiles: square parts of an assembly that are advanced in parallel, each with the pairs of its discs.
//!
//! A pair of discs in one tile is evaluated once. A pair across a border is evaluated by both tiles: the law
//! is antisymmetric in its two discs to the last bit, and each tile uses its side. No tile writes what
//! another one reads during a step, so results do not depend on the number of threads.

use serde::{Deserialize, Serialize};

use super::boundary::Body;
use crate::contact::ContactLaw;
use crate::disc::Disc;
use crate::integrate::damp;
use crate::real::Real;

/// Two discs that can touch before the next listing, by their places in the assembly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct Pair<R: Real> {
    /// A disc of the tile.
    pub i: u32,
    pub j: u32,
    pub contact: History<R>,
    /// Normal dashpot (kg/s).
    pub dashpot: R,
}

/// A disc and a rigid box that can touch before the next listing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct BodyPair<R: Real> {
    pub disc: u32,
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

/// Discs `first..end` of the assembly and their pairs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct Tile<R: Real> {
    /// Column and row of the tile.
    pub place: [u32; 2],
    pub first: u32,
    pub end: u32,
    /// Places in the list of tiles: this tile and those around it.
    pub around: Vec<u32>,
    /// Discs of other tiles that can come near before the next sort.
    pub halo: Vec<u32>,
    /// Pairs of own discs, in the order of `i`, the smaller one.
    pub inner: Vec<Pair<R>>,
    /// Pairs of an own disc and one of the halo, in the order of `i`, the own one.
    pub outer: Vec<Pair<R>>,
    /// In the order of discs, then of bodies.
    pub bodies: Vec<BodyPair<R>>,
    /// Positions of the own discs and of the halo when pairs were listed.
    pub reference: Vec<[R::Fraction; 2]>,
    /// When pairs were listed (s).
    pub listed: f64,
    /// Upper bound of the displacement of any of these discs since then (m).
    pub travel: f64,
}

/// Buffers of a step, which tiles share one after the other.
#[derive(Clone, Debug, Default)]
pub(super) struct Work<R: Real> {
    /// Force (N) and torque (N m) on each own disc.
    forces: Vec<[R; 4]>,
    /// Indices of the touching pairs, then unused entries.
    touching: Vec<u32>,
    /// Branch vectors of the touching pairs (m), then unused entries.
    branch: Vec<[R; 2]>,
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

/// Pairs or discs treated side by side, one per SIMD lane.
const LANES: usize = 8;

impl<R: Real> Tile<R> {
    /// Number of own discs.
    pub fn len(&self) -> usize {
        (self.end - self.first) as usize
    }

    /// Own discs, then the halo, by their places in the assembly.
    pub fn nearby(&self) -> impl Iterator<Item = u32> {
        (self.first..self.end).chain(self.halo.iter().copied())
    }

    /// Largest displacement of a nearby disc since pairs were listed, in units of [`Real::Fraction`].
    pub fn displacement(&self, discs: &[Disc<R>]) -> f64 {
        let squares = self.nearby().zip(&self.reference).map(|(k, reference)| {
            let s = discs[k as usize].s;
            let [x, y] = [0, 1].map(|k| R::nearest(reference[k], s[k]).to_f64());
            x * x + y * y
        });
        squares.fold(0.0, f64::max).sqrt()
    }

    /// Advances the own discs by one step, from the assembly's `discs` into `next`.
    pub fn advance(
        &mut self,
        step: &Step<'_, R>,
        discs: &[Disc<R>],
        next: &mut [Disc<R>],
        work: &mut Work<R>,
    ) -> TileSums<R> {
        // The same arithmetic without fused operations: the same bits on every processor.
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2.
            return unsafe { self.advance_avx2(step, discs, next, work) };
        }
        self.advance_portable(step, discs, next, work)
    }

    /// [`Self::advance_portable`], compiled with 32-byte vectors.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn advance_avx2(
        &mut self,
        step: &Step<'_, R>,
        discs: &[Disc<R>],
        next: &mut [Disc<R>],
        work: &mut Work<R>,
    ) -> TileSums<R> {
        self.advance_portable(step, discs, next, work)
    }

    #[inline(always)]
    fn advance_portable(
        &mut self,
        step: &Step<'_, R>,
        discs: &[Disc<R>],
        next: &mut [Disc<R>],
        work: &mut Work<R>,
    ) -> TileSums<R> {
        let Self { inner, outer, bodies, first, end, .. } = self;
        let own = *first as usize..*end as usize;
        work.forces.clear();
        work.forces.resize(own.len(), [R::default(); 4]);
        let mut sums = TileSums::default();
        let contacts = find_touching(inner, discs, work, step.unit);
        evaluate::<R, true>(inner, contacts, discs, *first, work, &step.law, &mut sums);
        let contacts = find_touching(outer, discs, work, step.unit);
        evaluate::<R, false>(outer, contacts, discs, *first, work, &step.law, &mut sums);
        evaluate_bodies(bodies, discs, *first, &mut work.forces, step, &mut sums);
        let own = &discs[own];
        if step.law.local_damping != R::default() || step.drag != R::default() {
            resist(own, &mut work.forces, step, &mut sums);
        }
        integrate(own, &work.forces, step, next, &mut sums);
        sums
    }
}

/// Lists the touching pairs with their branch vectors, without branching on whether a pair touches, and
/// ends the history of the others. Returns how many touch.
#[inline(always)]
fn find_touching<R: Real>(
    pairs: &mut [Pair<R>],
    discs: &[Disc<R>],
    work: &mut Work<R>,
    unit: R,
) -> usize {
    let (zero, one) = (R::default(), R::from_f64(1.0));
    // One more than can be used: the entry after the last touching pair is written speculatively.
    let longest = work.touching.len().max(pairs.len() + 1);
    work.touching.resize(longest, 0);
    work.branch.resize(longest, [zero; 2]);
    let (touching, branch) = (&mut work.touching[..longest], &mut work.branch[..longest]);
    let (mut contacts, mut index) = (0, 0);
    for chunk in pairs.chunks_mut(LANES) {
        let (mut x, mut y, mut reach) = ([zero; LANES], [zero; LANES], [zero; LANES]);
        for (k, pair) in chunk.iter().enumerate() {
            let (a, b) = (&discs[pair.i as usize], &discs[pair.j as usize]);
            x[k] = R::nearest(a.s[0], b.s[0]);
            y[k] = R::nearest(a.s[1], b.s[1]);
            reach[k] = a.r + b.r;
        }
        let (mut touches, mut keep) = ([0; LANES], [zero; LANES]);
        for k in 0..LANES {
            (x[k], y[k]) = (unit * x[k], unit * y[k]);
            let touch = x[k] * x[k] + y[k] * y[k] < reach[k] * reach[k];
            touches[k] = u32::from(touch);
            keep[k] = if touch { one } else { zero };
        }
        for (k, pair) in chunk.iter_mut().enumerate() {
            touching[contacts] = index;
            branch[contacts] = [x[k], y[k]];
            contacts += touches[k] as usize;
            index += 1;
            pair.contact.tangential = pair.contact.tangential * keep[k];
            pair.contact.viscous = pair.contact.viscous * keep[k];
        }
    }
    contacts
}

/// Power (W) of the dashpot and of sliding over a step, by the mean of the forces at its two ends, less what
/// the tangential spring, of `compliance` $1 / (2 k_t \Delta t)$, stores. Both take energy where they are negative.
#[inline(always)]
fn power<R: Real>([old, new]: [History<R>; 2], [vn, vt]: [R; 2], compliance: R) -> [R; 2] {
    let half = R::from_f64(0.5);
    let dashpot = half * (new.viscous + old.viscous) * vn;
    let sum = new.tangential + old.tangential;
    let sliding = sum * (half * vt + (new.tangential - old.tangential) * compliance);
    [dashpot, sliding]
}

/// Contact law of the touching pairs, [`LANES`] at a time: gather, compute, scatter. Of pairs that are not
/// `INNER`, another tile has the second disc.
#[inline(always)]
fn evaluate<R: Real, const INNER: bool>(
    pairs: &mut [Pair<R>],
    contacts: usize,
    discs: &[Disc<R>],
    first: u32,
    work: &mut Work<R>,
    law: &ContactLaw<R>,
    sums: &mut TileSums<R>,
) {
    let (zero, half, one) = (R::default(), R::from_f64(0.5), R::from_f64(1.0));
    let compliance = half / (law.tangential_stiffness * law.dt);
    let Work { forces, touching, branch } = work;
    let forces = forces.as_mut_slice();
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

        // Force and torque on the first disc of each pair and on the second one.
        let (mut on_i, mut on_j) = ([[zero; 4]; LANES], [[zero; 4]; LANES]);
        for k in 0..LANES {
            let length = (lx[k] * lx[k] + ly[k] * ly[k]).sqrt();
            let inverse = one / length;
            let (nx, ny) = (lx[k] * inverse, ly[k] * inverse);
            let overlap = ri[k] + rj[k] - length;
            let (arm_i, arm_j) = (ri[k] - half * overlap, rj[k] - half * overlap);
            let vn = ux[k] * nx + uy[k] * ny;
            let vt = (uy[k] * nx - ux[k] * ny) - (arm_i * wi[k] + arm_j * wj[k]);
            let [normal, ft] =
                law.forces(overlap, [vn, vt], dashpot[k], tangential[k], law.friction);

            let new = History { tangential: ft, viscous: normal - law.normal_stiffness * overlap };
            let old = History { tangential: tangential[k], viscous: viscous[k] };
            let [of_dashpot, of_sliding] = power([old, new], [vn, vt], compliance);
            dashpots[k] += of_dashpot;
            friction[k] += of_sliding;
            (tangential[k], viscous[k]) = (new.tangential, new.viscous);
            deepest[k] = deepest[k].max(overlap / ri[k].min(rj[k]));

            let (fx, fy) = (normal * nx - ft * ny, normal * ny + ft * nx);
            on_i[k] = [fx, fy, ft * arm_i, zero];
            on_j[k] = [fx, fy, -(ft * arm_j), zero];
        }

        for (k, &index) in chunk.iter().enumerate() {
            let pair = &mut pairs[index as usize];
            pair.contact = History { tangential: tangential[k], viscous: viscous[k] };
            let force = &mut forces[(pair.i - first) as usize];
            *force = [0, 1, 2, 3].map(|c| force[c] - on_i[k][c]);
            if INNER {
                let force = &mut forces[(pair.j - first) as usize];
                *force = [0, 1, 2, 3].map(|c| force[c] + on_j[k][c]);
            }
        }
    }
    // Both tiles count a pair across their border.
    let weight = R::from_f64(if INNER { 1.0 } else { 0.5 });
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
    discs: &[Disc<R>],
    first: u32,
    forces: &mut [[R; 4]],
    step: &Step<'_, R>,
    sums: &mut TileSums<R>,
) {
    let law = &step.law;
    let (zero, half) = (R::default(), R::from_f64(0.5));
    let compliance = half / (law.tangential_stiffness * law.dt);
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
        let old = pair.contact;
        let friction = body.friction(branch);
        let [normal, ft] = law.forces(overlap, [vn, vt], pair.dashpot, old.tangential, friction);
        let new = History { tangential: ft, viscous: normal - law.normal_stiffness * overlap };
        let [of_dashpot, of_sliding] = power([old, new], [vn, vt], compliance);
        sums.dashpots += -of_dashpot;
        sums.friction += -of_sliding;
        pair.contact = new;

        // Force of the disc on the box.
        let (fx, fy) = (normal * nx - ft * ny, normal * ny + ft * nx);
        sums.boxes += -(fx * body.velocity[0] + fy * body.velocity[1]);
        sums.overlap = sums.overlap.max(overlap / disc.r);
        let force = &mut forces[(pair.disc - first) as usize];
        force[0] -= fx;
        force[1] -= fy;
        force[2] -= ft * length;
    }
}

/// Takes what local damping and drag resist with from the forces.
#[inline(always)]
fn resist<R: Real>(
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

/// One step of symplectic Euler (leapfrog with velocities at half steps). Fixed discs stay.
#[inline(always)]
fn integrate<R: Real>(
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
    // Not only the maximum: comparisons drop NaN, a sum keeps it.
    let (mut fastest, mut sum) = (zero, zero);
    let chunks = own.chunks(LANES).zip(forces.chunks(LANES));
    for ((own, forces), next) in chunks.zip(next.chunks_mut(LANES)) {
        let mut positions = [[R::Fraction::default(); 2]; LANES];
        let mut moves = [[zero; 2]; LANES];
        for (k, ((old, force), new)) in own.iter().zip(forces).zip(&mut *next).enumerate() {
            let [gx, gy] = if old.inv_mass == zero { [zero; 2] } else { falls };
            let kick = dt * old.inv_mass;
            let ux = old.u[0] + (force[0] * kick + gx);
            let uy = old.u[1] + (force[1] * kick + gy);
            let w = old.w + force[2] * (dt * old.inv_inertia);
            *new = Disc { u: [ux, uy], w, ..*old };
            (positions[k], moves[k]) = (old.s, [per_unit * ux, per_unit * uy]);
            let speed2 = ux * ux + uy * uy;
            fastest = fastest.max(speed2);
            sum += speed2 + w * w;
        }
        for (s, &step) in positions.as_flattened_mut().iter_mut().zip(moves.as_flattened()) {
            *s = R::advance(*s, step);
        }
        for (new, &s) in next.iter_mut().zip(&positions) {
            new.s = s;
        }
    }
    let finite = sum.to_f64().is_finite();
    sums.fastest = if finite { fastest.sqrt() } else { R::from_f64(f64::NAN) };
}
