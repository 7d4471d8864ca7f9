//! Contact forces: linear springs, dashpot, Coulomb friction and rolling resistance.
//!
//! The law of Cundall & Strack (1979), Géotechnique 29, 47: with overlap $\delta$, normal velocity $v_n$
//! and tangential velocity $v_t$ of the contact,
//!
//! $$ f_n = \max(0,  k_n \delta - c v_n), \qquad
//! \Delta f_t = -k_t v_t \Delta t, \qquad |f_t| \le \mu f_n, $$
//!
//! with the dashpot $c = 2 \zeta \sqrt{m_\text{eff} k_n}$.
//!
//! Rolling is resisted by a spring, a dashpot and a slider (Luding 2008, Granular Matter 10, 235; model C of Ai,
//! Chen, Rotter & Ooi 2011, Powder Technology 206, 269). With the reduced radius $R = r_i r_j / (r_i + r_j)$ and
//! the rolling velocity $v_r = R (\omega_j - \omega_i)$, discs resist with the torques $\mp R f_r$ on $i$ and $j$,
//!
//! $$ \Delta s = -k_r v_r \Delta t, \qquad f_r = s - c_r v_r, \qquad |s|, |f_r| \le \mu_r f_n, $$
//!
//! with the dashpot $c_r = 2 \zeta \sqrt{m_\text{eff} k_r} = c \sqrt{k_r / k_n}$. A rigid rotation of both discs
//! is no rolling. Without rolling friction, $\mu_r = 0$, none of this is computed or stored.

use nalgebra::Matrix2;

use crate::disc::Disc;
use crate::grains::Grains;
use crate::neighbours::{Image2, Neighbours, Pair};
use crate::packing::Packing;
use crate::real::Real;

/// The contact law and the step, in working precision.
#[derive(Clone, Copy, Debug)]
pub struct ContactLaw<R: Real> {
    /// $k_n$ (N/m).
    pub normal_stiffness: R,
    /// $k_t$ (N/m).
    pub tangential_stiffness: R,
    /// Coefficient of friction $\mu$.
    pub friction: R,
    /// Coefficient of rolling friction $\mu_r$; 0: there is no rolling resistance.
    pub rolling_friction: R,
    /// $k_r$ (N/m).
    pub rolling_stiffness: R,
    /// $\zeta$, as a fraction of critical damping.
    pub damping_ratio: R,
    /// Cundall's local damping $\alpha$, applied in the integration.
    pub local_damping: R,
    /// DEM step (s).
    pub dt: R,
}

impl<R: Real> ContactLaw<R> {
    /// The law at a DEM step of `dt` (s), with the friction and damping of flow.
    pub fn new(grains: &Grains, dt: f64) -> Self {
        Self {
            normal_stiffness: R::from_f64(grains.normal_stiffness),
            tangential_stiffness: R::from_f64(grains.tangential_stiffness),
            friction: R::from_f64(grains.friction),
            rolling_friction: R::from_f64(grains.rolling_friction),
            rolling_stiffness: R::from_f64(grains.rolling_stiffness),
            damping_ratio: R::from_f64(grains.damping_ratio),
            local_damping: R::from_f64(grains.local_damping),
            dt: R::from_f64(dt),
        }
    }

    /// Normal and tangential force (N) of a contact after one step, from its overlap (m), its normal and
    /// tangential velocity (m/s), its dashpot (kg/s), its tangential force before, and its friction.
    #[inline(always)]
    pub(crate) fn forces(
        &self,
        overlap: R,
        [vn, vt]: [R; 2],
        dashpot: R,
        tangential: R,
        friction: R,
    ) -> [R; 2] {
        // The dashpot must not pull: f_n >= 0.
        let normal = (self.normal_stiffness * overlap - dashpot * vn).max(R::default());
        let limit = friction * normal;
        let trial = tangential - self.tangential_stiffness * self.dt * vt;
        [normal, trial.max(-limit).min(limit)]
    }

    /// Overlap (m) that the spring of a contact pushes with, so that its work in leapfrog steps is what it stores, and
    /// whether the contact opens in this step:
    ///
    /// $$ \bar\delta = \tfrac12 \delta \left(1 + \min(1, \delta / s)\right) $$
    ///
    /// where the contact moves by $s$ in the step that closed or will open it. Only a part $\delta / s$ of such a step
    /// stretches the spring. With $\delta$ itself, a contact that closes to $\delta$ lacks
    /// $k_n \delta (s - \delta) / 2$ and gains as much where it opens, which a dashpot in between makes less.
    ///
    /// From the overlap (m), the normal velocity (m/s), the dashpot (kg/s) and the inverse of the effective mass (1/kg).
    #[inline(always)]
    pub(crate) fn mean_overlap(&self, overlap: R, vn: R, dashpot: R, inv_mass: R) -> (R, bool) {
        let overlap = overlap.max(R::default());
        let push = (self.normal_stiffness * overlap - dashpot * vn).max(R::default());
        let opening = self.dt * (vn + self.dt * inv_mass * push);
        let travel = opening.max(-(self.dt * vn));
        let mean = R::from_f64(0.5) * overlap * (R::from_f64(1.0) + overlap / travel);
        (if overlap < travel { mean } else { overlap }, overlap < opening)
    }

    /// Whether contacts resist rolling.
    pub(crate) fn resists_rolling(&self) -> bool {
        self.rolling_friction != R::default()
    }

    /// The dashpot of a rolling spring over that of the normal one: $\sqrt{k_r / k_n}$.
    pub(crate) fn rolling_dashpot(&self) -> R {
        (self.rolling_stiffness / self.normal_stiffness).sqrt()
    }

    /// Force of the rolling spring after one step (N), and that of spring and dashpot $f_r$ (N), from the rolling
    /// velocity (m/s), the dashpot (kg/s), the force of the spring before and that of the normal contact.
    #[inline(always)]
    pub(crate) fn rolling_forces(&self, vr: R, dashpot: R, spring: R, normal: R) -> [R; 2] {
        let limit = self.rolling_friction * normal;
        let spring = spring - self.rolling_stiffness * self.dt * vr;
        let spring = spring.max(-limit).min(limit);
        [spring, (spring - dashpot * vr).max(-limit).min(limit)]
    }

    /// Normal dashpot of a pair (kg/s): $2 \zeta \sqrt{m_\text{eff} k_n}$ with
    /// $m_\text{eff} = m_i m_j / (m_i + m_j)$.
    pub fn dashpot(&self, a: &Disc<R>, b: &Disc<R>) -> R {
        let two = R::from_f64(2.0);
        two * self.damping_ratio * (self.normal_stiffness / (a.inv_mass + b.inv_mass)).sqrt()
    }

    /// Normal dashpot of a disc and a rigid body (kg/s), with the mass of the disc.
    pub(crate) fn body_dashpot(&self, disc: &Disc<R>) -> R {
        R::from_f64(2.0) * self.damping_ratio * (self.normal_stiffness / disc.inv_mass).sqrt()
    }
}

/// Sums over the contacts of one force evaluation.
#[derive(Clone, Copy, Debug, Default)]
pub struct ContactSums {
    /// $\sum \mathbf f \otimes \mathbf l$ (N m), row by row: force of `i` on `j` times branch from `i` to
    /// `j`, so that compression is positive.
    pub force_branch: [f64; 4],
    /// Number of touching pairs.
    pub contacts: u32,
    /// Largest overlap over the smaller radius of the pair.
    pub relative_overlap: f64,
}

/// Force (N) and torque (N m) on a disc, padded to four numbers.
pub type Force<R> = [R; 4];

/// Result and buffers of a force evaluation, kept from step to step so that none allocates.
#[derive(Clone, Debug, Default)]
pub struct Forces<R: Real> {
    /// Force and torque on each disc.
    pub on_disc: Vec<Force<R>>,
    /// Indices of the touching pairs, then unused entries.
    touching: Vec<u32>,
    /// Branch vectors of the touching pairs (m), then unused entries.
    branch: Vec<[R; 2]>,
    /// Forces of the rolling springs before the step (N), by pair.
    rolling: Vec<R>,
}

/// Contacts evaluated side by side, one per SIMD lane.
const LANES: usize = 8;

/// Evaluates all contacts: writes forces and torques to `forces` and advances the springs by one step.
/// `velocity_gradient` is that of the cell (1/s).
pub fn contact_forces<R: Real>(
    packing: &mut Packing<R>,
    law: &ContactLaw<R>,
    velocity_gradient: &Matrix2<f64>,
    forces: &mut Forces<R>,
) -> ContactSums {
    let Neighbours { pairs, rolling, .. } = &mut packing.neighbours;
    if law.resists_rolling() {
        std::mem::swap(rolling, &mut forces.rolling);
        forces.rolling.resize(pairs.len(), R::default());
        // Of pairs that do not touch the springs end.
        rolling.clear();
        rolling.resize(pairs.len(), R::default());
        vectorised::<R, true>(packing, law, velocity_gradient, forces)
    } else {
        rolling.clear();
        vectorised::<R, false>(packing, law, velocity_gradient, forces)
    }
}

/// [`portable`], with the widest vectors that the processor has. The same arithmetic without fused operations:
/// the same bits on every processor.
fn vectorised<R: Real, const ROLLING: bool>(
    packing: &mut Packing<R>,
    law: &ContactLaw<R>,
    velocity_gradient: &Matrix2<f64>,
    forces: &mut Forces<R>,
) -> ContactSums {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        return unsafe { with_avx2::<R, ROLLING>(packing, law, velocity_gradient, forces) };
    }
    portable::<R, ROLLING>(packing, law, velocity_gradient, forces)
}

/// [`portable`], compiled with 32-byte vectors.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2<R: Real, const ROLLING: bool>(
    packing: &mut Packing<R>,
    law: &ContactLaw<R>,
    velocity_gradient: &Matrix2<f64>,
    forces: &mut Forces<R>,
) -> ContactSums {
    portable::<R, ROLLING>(packing, law, velocity_gradient, forces)
}

#[inline(always)]
fn portable<R: Real, const ROLLING: bool>(
    packing: &mut Packing<R>,
    law: &ContactLaw<R>,
    velocity_gradient: &Matrix2<f64>,
    forces: &mut Forces<R>,
) -> ContactSums {
    let h = rows(&(packing.cell.h * R::UNIT));
    let discs = &packing.discs;
    let list = &mut packing.neighbours;
    let contacts = if list.images.is_empty() {
        let nearest =
            |a: &Disc<R>, b: &Disc<R>, _| [R::nearest(a.s[0], b.s[0]), R::nearest(a.s[1], b.s[1])];
        find_touching(discs, &mut list.pairs, &h, forces, nearest)
    } else {
        let images: &[Image2] = &list.images;
        let imaged = |a: &Disc<R>, b: &Disc<R>, index: usize| {
            let image = images[index];
            [R::image(a.s[0], b.s[0], image[0]), R::image(a.s[1], b.s[1], image[1])]
        };
        find_touching(discs, &mut list.pairs, &h, forces, imaged)
    };
    let Neighbours { pairs, rolling, .. } = list;
    let gradient = rows(velocity_gradient);
    evaluate::<R, ROLLING>(discs, pairs, rolling, contacts, law, &gradient, forces)
}

/// A matrix in working precision, row-major.
fn rows<R: Real>(m: &Matrix2<f64>) -> [R; 4] {
    [m[(0, 0)], m[(0, 1)], m[(1, 0)], m[(1, 1)]].map(R::from_f64)
}

/// Lists the touching pairs with their branch vectors, without branching on whether a pair
/// touches, and ends the history of the others. Returns how many touch.
#[inline(always)]
fn find_touching<R: Real>(
    discs: &[Disc<R>],
    pairs: &mut [Pair<R>],
    h: &[R; 4],
    forces: &mut Forces<R>,
    separation: impl Fn(&Disc<R>, &Disc<R>, usize) -> [R; 2],
) -> usize {
    // One more than can be used: the entry after the last touching pair is written speculatively.
    forces.touching.resize(pairs.len() + 1, 0);
    forces.branch.resize(pairs.len() + 1, [R::default(); 2]);
    let keep = [R::default(), R::from_f64(1.0)];
    let mut contacts = 0;
    for (index, pair) in pairs.iter_mut().enumerate() {
        let (a, b) = (&discs[pair.i as usize], &discs[pair.j as usize]);
        let [sx, sy] = separation(a, b, index);
        let lx = h[0] * sx + h[1] * sy;
        let ly = h[2] * sx + h[3] * sy;
        let reach = a.r + b.r;
        let touches = usize::from(lx * lx + ly * ly < reach * reach);
        forces.touching[contacts] = index as u32;
        forces.branch[contacts] = [lx, ly];
        contacts += touches;
        pair.tangential = pair.tangential * keep[touches];
    }
    contacts
}

/// Contact law of the touching pairs, [`LANES`] at a time: gather, compute, scatter. `rolling` takes the springs
/// of pairs that resist `ROLLING`, and is empty otherwise.
#[inline(always)]
fn evaluate<R: Real, const ROLLING: bool>(
    discs: &[Disc<R>],
    pairs: &mut [Pair<R>],
    rolling: &mut [R],
    contacts: usize,
    law: &ContactLaw<R>,
    l: &[R; 4],
    forces: &mut Forces<R>,
) -> ContactSums {
    let zero = R::default();
    let half = R::from_f64(0.5);
    let one = R::from_f64(1.0);
    let Forces { on_disc, touching, branch, rolling: rolling_before } = forces;
    let rolling_dashpot = if ROLLING { law.rolling_dashpot() } else { zero };
    on_disc.clear();
    on_disc.resize(discs.len(), [zero; 4]);
    let mut sum = [[zero; LANES]; 4];
    let mut deepest = [zero; LANES];

    let touching = touching[..contacts].chunks(LANES);
    for (chunk, branch) in touching.zip(branch[..contacts].chunks(LANES)) {
        // Lanes beyond the last contact hold two discs of radius 1/2 that just touch.
        let (mut lx, mut ly) = ([one; LANES], [zero; LANES]);
        let (mut ux, mut uy) = ([zero; LANES], [zero; LANES]);
        let (mut ri, mut rj) = ([half; LANES], [half; LANES]);
        let (mut wi, mut wj) = ([zero; LANES], [zero; LANES]);
        let (mut tangential, mut dashpot) = ([zero; LANES], [zero; LANES]);
        let mut spring = [zero; LANES];
        for (k, &index) in chunk.iter().enumerate() {
            let pair = &pairs[index as usize];
            let (a, b) = (&discs[pair.i as usize], &discs[pair.j as usize]);
            [lx[k], ly[k]] = branch[k];
            ux[k] = b.u[0] - a.u[0];
            uy[k] = b.u[1] - a.u[1];
            (ri[k], rj[k]) = (a.r, b.r);
            (wi[k], wj[k]) = (a.w, b.w);
            tangential[k] = pair.tangential;
            dashpot[k] = pair.dashpot;
            if ROLLING {
                spring[k] = rolling_before[index as usize];
            }
        }

        let (mut fx, mut fy) = ([zero; LANES], [zero; LANES]);
        let (mut torque_i, mut torque_j) = ([zero; LANES], [zero; LANES]);
        for k in 0..LANES {
            let length = (lx[k] * lx[k] + ly[k] * ly[k]).sqrt();
            let inverse = one / length;
            let (nx, ny) = (lx[k] * inverse, ly[k] * inverse);
            let overlap = ri[k] + rj[k] - length;
            let (arm_i, arm_j) = (ri[k] - half * overlap, rj[k] - half * overlap);

            // v = u_j - u_i + L l at the contact, normal and along tau = (-n_y, n_x).
            let vx = ux[k] + l[0] * lx[k] + l[1] * ly[k];
            let vy = uy[k] + l[2] * lx[k] + l[3] * ly[k];
            let vn = vx * nx + vy * ny;
            let vt = vy * nx - vx * ny - arm_i * wi[k] - arm_j * wj[k];

            let [normal, ft] =
                law.forces(overlap, [vn, vt], dashpot[k], tangential[k], law.friction);
            tangential[k] = ft;

            fx[k] = normal * nx - ft * ny;
            fy[k] = normal * ny + ft * nx;
            torque_i[k] = ft * arm_i;
            torque_j[k] = ft * arm_j;
            if ROLLING {
                let radius = ri[k] * rj[k] / (ri[k] + rj[k]);
                let vr = radius * (wj[k] - wi[k]);
                let dashpot = rolling_dashpot * dashpot[k];
                let [new, force] = law.rolling_forces(vr, dashpot, spring[k], normal);
                spring[k] = new;
                torque_i[k] += radius * force;
                torque_j[k] += -(radius * force);
            }
            sum[0][k] += fx[k] * lx[k];
            sum[1][k] += fx[k] * ly[k];
            sum[2][k] += fy[k] * lx[k];
            sum[3][k] += fy[k] * ly[k];
            deepest[k] = deepest[k].max(overlap / ri[k].min(rj[k]));
        }

        for (k, &index) in chunk.iter().enumerate() {
            let pair = &mut pairs[index as usize];
            pair.tangential = tangential[k];
            if ROLLING {
                rolling[index as usize] = spring[k];
            }
            let fi = &mut on_disc[pair.i as usize];
            fi[0] -= fx[k];
            fi[1] -= fy[k];
            fi[2] -= torque_i[k];
            let fj = &mut on_disc[pair.j as usize];
            fj[0] += fx[k];
            fj[1] += fy[k];
            fj[2] -= torque_j[k];
        }
    }
    ContactSums {
        force_branch: sum.map(|lanes| lanes.iter().map(|x| x.to_f64()).sum()),
        contacts: contacts as u32,
        relative_overlap: deepest.iter().fold(0.0, |d: f64, x| d.max(x.to_f64())),
    }
}
