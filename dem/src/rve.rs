//! One macro step of one RVE: substeps, averaged stress, and the limits of the method (stress-free, thin
//! and over-compressed cells).

use nalgebra::Matrix2;
use serde::{Deserialize, Serialize};

use crate::cell;
use crate::contact::{ContactLaw, ContactSums, Forces, contact_forces};
use crate::error::Failure;
use crate::homogenise;
use crate::integrate::integrate;
use crate::packing::Packing;
use crate::parameters::RveParameters;
use crate::real::Real;
use crate::state::RveState;

/// How a macro step is divided; the same for all RVEs of a batch.
#[derive(Clone, Debug)]
pub struct Substepping<R: Real> {
    /// The contact law at the substep.
    pub law: ContactLaw<R>,
    /// Substep (s).
    pub dt: f64,
    /// Substeps in a macro step.
    pub substeps: usize,
    /// Last substeps, over which stress is averaged.
    pub samples: usize,
}

impl<R: Real> Substepping<R> {
    /// Physical-time coupling: `ceil(dt / dt_DEM)` equal substeps make up `dt` (s).
    pub fn new(p: &RveParameters, dt: f64) -> Self {
        let substeps = p.grains.substeps(dt);
        let trailing = (p.stress_window * substeps as f64).ceil() as usize;
        let dt = dt / substeps as f64;
        Self {
            law: ContactLaw::new(&p.grains, dt),
            dt,
            substeps,
            samples: trailing.max(MIN_SAMPLES).min(substeps),
        }
    }
}

/// Solid fraction below which a stress-free RVE does not expand any more: a point that flies alone keeps its velocity
/// gradient, and its area would grow without bound.
pub(crate) const LEAST_SOLID_FRACTION: f64 = 0.01;

/// Fewest stress samples in a macro step, if it has as many substeps.
const MIN_SAMPLES: usize = 5;

/// A packing that follows one material point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Rve<R: Real> {
    /// The packing.
    pub packing: Packing<R>,
    /// Area (m²) while the RVE is too loose to carry stress. Its packing is then meaningless; a fresh one
    /// replaces it once the RVE is dense again.
    pub free_area: Option<f64>,
    /// Which of the fresh packings of its [batch](crate::RveBatch::fresh) that is.
    pub kind: u32,
}

/// What acts on the cell of a loaded RVE.
struct Drive {
    /// Velocity gradient (1/s).
    gradient: Matrix2<f64>,
    /// A cell too thin takes only the volumetric part and the spin: without further shear its contacts keep the
    /// deviatoric stress they have.
    thin: bool,
    /// A cell too dense takes no compression.
    dense: bool,
}

impl<R: Real> Rve<R> {
    /// An RVE that carries stress, of the first kind.
    pub fn new(packing: Packing<R>) -> Self {
        Self { packing, free_area: None, kind: 0 }
    }

    /// Cell area (m²).
    pub fn area(&self) -> f64 {
        self.free_area.unwrap_or_else(|| self.packing.cell.area())
    }

    /// Advances by one macro step under a constant velocity gradient `L` (1/s, `L_ij = dv_i/dx_j`).
    ///
    /// `fresh` is the packing a stress-free RVE restarts from, in a cell of its own shape.
    /// Afterwards `forces` holds those of the last substep.
    ///
    /// # Errors
    /// A number is not finite, or an overlap is beyond the limit.
    pub fn advance(
        &mut self,
        velocity_gradient: &Matrix2<f64>,
        p: &RveParameters,
        sub: &Substepping<R>,
        fresh: &Packing<R>,
        forces: &mut Forces<R>,
    ) -> Result<RveState, Failure> {
        let dt = sub.dt * sub.substeps as f64;
        if !velocity_gradient.iter().all(|x| x.is_finite()) {
            return Err(Failure::NotFinite);
        }
        if self.free_area.is_none() && self.packing.solid_fraction() < p.free_solid_fraction {
            self.free_area = Some(self.packing.cell.area());
        }
        if let Some(area) = self.free_area {
            return Ok(self.advance_free(area * (velocity_gradient.trace() * dt).exp(), p, fresh));
        }

        let Drive { gradient: drive, thin, dense } = self.drive(velocity_gradient, p, dt);
        self.packing.set_spin(&drive);
        self.packing.remove_drift();
        let increment = cell::exp(&(drive * sub.dt));
        let mut state = RveState { thin, dense, ..RveState::default() };
        self.update_neighbours(0.0, p, sub, &mut state);
        for n in 0..sub.substeps {
            let sums = self.substep(&drive, &increment, p, sub, forces, &mut state)?;
            if n + sub.samples >= sub.substeps {
                // Sampled after the move, with the forces of this substep.
                state.stress +=
                    homogenise::stress(&self.packing, &sums, p.grains.thickness, p.kinetic_stress)
                        / sub.samples as f64;
            }
            state.coordination = 2.0 * f64::from(sums.contacts) / self.packing.discs.len() as f64;
        }
        state.area = self.packing.cell.area();
        state.solid_fraction = self.packing.solid_fraction();
        state.min_width = self.packing.cell.min_width();
        Ok(state)
    }

    /// One DEM step: forces at the present positions, then motion.
    fn substep(
        &mut self,
        drive: &Matrix2<f64>,
        increment: &Matrix2<f64>,
        p: &RveParameters,
        sub: &Substepping<R>,
        forces: &mut Forces<R>,
        state: &mut RveState,
    ) -> Result<ContactSums, Failure> {
        let sums = contact_forces(&mut self.packing, &sub.law, drive, forces);
        state.relative_overlap = state.relative_overlap.max(sums.relative_overlap);
        if sums.relative_overlap > p.grains.overlap_limit {
            return Err(Failure::Overlap(sums.relative_overlap));
        }
        let fastest = integrate(&mut self.packing, &sub.law, drive, increment, &forces.on_disc);
        if !fastest.is_finite() {
            return Err(Failure::NotFinite);
        }
        self.update_neighbours(fastest * sub.dt, p, sub, state);
        Ok(sums)
    }

    /// Searches neighbours anew if, after moves of at most `moved` (m), the list could miss a
    /// contact, or if the lattice became oblique.
    fn update_neighbours(
        &mut self,
        moved: f64,
        p: &RveParameters,
        sub: &Substepping<R>,
        state: &mut RveState,
    ) {
        let Packing { cell, discs, neighbours, .. } = &mut self.packing;
        if neighbours.outdated(cell, discs, moved) || cell.reduction().is_some() {
            self.packing.search(p.grains.skin * p.grains.radius_max, |a, b| sub.law.dashpot(a, b));
            state.searches += 1;
        }
    }

    /// The velocity gradient that acts on the cell.
    fn drive(&self, l: &Matrix2<f64>, p: &RveParameters, dt: f64) -> Drive {
        let mut gradient = *l;
        let thin = self.becomes_too_thin(l, p, dt);
        if thin {
            let spin = 0.5 * (l[(1, 0)] - l[(0, 1)]);
            let volumetric = 0.5 * l.trace();
            gradient = Matrix2::new(volumetric, -spin, spin, volumetric);
        }
        let dense = gradient.trace() < 0.0 && self.packing.solid_fraction() > p.max_solid_fraction;
        if dense {
            gradient -= Matrix2::identity() * (0.5 * gradient.trace());
        }
        Drive { gradient, thin, dense }
    }

    /// Whether the cell is too thin for its discs and would become thinner in `dt` (s).
    fn becomes_too_thin(&self, l: &Matrix2<f64>, p: &RveParameters, dt: f64) -> bool {
        let cell = self.packing.cell;
        let width = cell.min_width();
        if width >= p.thin_width * p.grains.mean_diameter() {
            return false;
        }
        let next = cell::Cell { h: cell::exp(&(l * dt)) * cell.h };
        let holds = next.min_width() >= width;
        !holds
    }

    /// A stress-free RVE only keeps its area. Dense enough again, it restarts from `fresh`,
    /// scaled to that area: no overlaps as long as `fresh` is the denser of the two.
    fn advance_free(&mut self, area: f64, p: &RveParameters, fresh: &Packing<R>) -> RveState {
        let solid = fresh.solid_fraction() * fresh.cell.area();
        let area = area.min(solid / LEAST_SOLID_FRACTION);
        let solid_fraction = solid / area;
        self.free_area = Some(area);
        if solid_fraction >= p.free_solid_fraction {
            self.packing.clone_from(fresh);
            self.packing.cell.h *= (area / fresh.cell.area()).sqrt();
            self.free_area = None;
        }
        RveState {
            area,
            solid_fraction,
            min_width: f64::INFINITY,
            free: true,
            ..RveState::default()
        }
    }
}
