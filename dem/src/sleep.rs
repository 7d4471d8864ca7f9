//! Sleep: a packing whose answer is known makes no DEM step.
//!
//! Since its last DEM step the packing was deformed by $\mathbf F = \mathbf R \mathbf U$, with rotation $\mathbf R$ and
//! strain $\boldsymbol\varepsilon = \mathbf U - \mathbf I$. Asleep it answers as the springs and dashpots of its contacts
//! do under an affine deformation (the mean field of Voigt), compression positive:
//!
//! $$ \boldsymbol\sigma = \mathbf R (\boldsymbol\sigma_0 + \Delta\boldsymbol\sigma) \mathbf R^T -
//! 2 \eta c (\operatorname{tr} \mathbf D) \mathbf I - 2 \eta c \operatorname{dev} \mathbf D, \qquad
//! \Delta\boldsymbol\sigma = - c \left(2 k_n (\operatorname{tr} \boldsymbol\varepsilon) \mathbf I +
//! 2 (k_n + k_t) \operatorname{dev} \boldsymbol\varepsilon\right), \qquad c = \frac{Z \phi}{4 \pi t}. $$
//!
//! It sleeps as long as $|\Delta\boldsymbol\sigma| \le s\, |\boldsymbol\sigma_0|$ with the parameter
//! [`sleep_stress`](RveParameters::sleep_stress) $s$, if in the last DEM step this answer was no further than
//! $s\, |\boldsymbol\sigma| / 5$ from the stress that was computed: grains that slide against each other pass the first
//! condition in slow flow under high pressure, but not this one. When it wakes, its next DEM step takes it through all of
//! $\mathbf F$.

use nalgebra::Matrix2;
use serde::{Deserialize, Serialize};

use crate::cell;
use crate::parameters::RveParameters;
use crate::state::RveState;

/// Largest rotation asleep (rad): a packing turns by it within a macro step when it wakes.
pub(crate) const LARGEST_TURN: f64 = 1.0e-2;
/// The answer is right if it is off by this part of what a packing asleep may change its stress.
pub(crate) const RIGHT: f64 = 0.2;
/// Largest compressive strain of a packing without contacts asleep: as little as one macro step of slow flow brings.
pub(crate) const LARGEST_CLOSING: f64 = 1.0e-5;
/// Largest tensile strain of a packing without contacts asleep: its solid fraction hardly falls meanwhile.
pub(crate) const LARGEST_OPENING: f64 = 1.0e-2;

/// What an RVE knows of itself since its last DEM step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sleep {
    /// Whether it is computed in every step, to measure the error of sleep.
    pub audited: bool,
    /// Whether the elastic answer was right in the last DEM step.
    pub settled: bool,
    /// Whether it has slept since.
    pub slept: bool,
    /// Stress (Pa) then, without that of dashpots.
    pub base: Matrix2<f64>,
    /// Coordination number then.
    pub coordination: f64,
    /// Stiffness of the packing over that of its contacts then (1/m): `c` of the module.
    pub fabric: f64,
    /// Deformation gradient since then.
    pub deformation: Matrix2<f64>,
}

/// Bulk and shear stiffness of contacts (N/m), or of their dashpots (N s/m).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moduli {
    pub bulk: f64,
    pub shear: f64,
}

/// Of springs.
pub(crate) fn springs(p: &RveParameters) -> Moduli {
    let [kn, kt] = [p.grains.normal_stiffness, p.grains.tangential_stiffness];
    Moduli { bulk: 2.0 * kn, shear: kn + kt }
}

/// Of dashpots, between discs of mean diameter.
pub(crate) fn dashpots(p: &RveParameters) -> Moduli {
    let g = &p.grains;
    let mass = 0.5 * g.mass_scale * g.disc_mass(0.5 * g.mean_diameter());
    let eta = 2.0 * g.damping_ratio * (mass * g.normal_stiffness).sqrt();
    Moduli { bulk: 2.0 * eta, shear: eta }
}

/// Stiffness of a packing over that of its contacts (1/m).
pub(crate) fn fabric(p: &RveParameters, coordination: f64, solid_fraction: f64) -> f64 {
    coordination * solid_fraction / (4.0 * std::f64::consts::PI * p.grains.thickness)
}

impl Default for Sleep {
    fn default() -> Self {
        Self {
            audited: false,
            settled: false,
            slept: false,
            base: Matrix2::zeros(),
            coordination: 0.0,
            fabric: 0.0,
            deformation: Matrix2::identity(),
        }
    }
}

impl Sleep {
    /// Takes the deformation of a macro step (velocity gradient times step) and tells whether to sleep in it.
    pub(crate) fn follow(&mut self, increment: &Matrix2<f64>, p: &RveParameters) -> bool {
        self.deformation = cell::exp(increment) * self.deformation;
        let asleep = self.settled && self.is_quiet(p);
        self.slept |= asleep;
        asleep
    }

    /// The deformation gradient that the packing has yet to follow, if it has slept.
    pub(crate) fn pending(&self) -> Option<&Matrix2<f64>> {
        (self.slept && !self.audited).then_some(&self.deformation)
    }

    /// The velocity gradient (1/s) in a macro step of `dt` (s) that makes up for those asleep.
    pub(crate) fn gradient(&self, l: &Matrix2<f64>, dt: f64) -> Matrix2<f64> {
        self.pending().map_or(*l, |f| cell::log(f) / dt)
    }

    /// Stress (Pa, compression positive) at a velocity gradient (1/s).
    pub(crate) fn stress(&self, l: &Matrix2<f64>, p: &RveParameters) -> Matrix2<f64> {
        let (rotation, strain) = polar(&self.deformation);
        let elastic = self.base + self.answer(&strain, springs(p));
        rotation * elastic * rotation.transpose() + self.answer(&strain_rate(l), dashpots(p))
    }

    /// Compares the answer of sleep with the state after a DEM step under a velocity gradient (1/s). An audited RVE
    /// that was to be `asleep` stays so; gives the error of its stress (Pa), else 0.
    pub(crate) fn compare(
        &mut self,
        asleep: bool,
        l: &Matrix2<f64>,
        p: &RveParameters,
        state: &RveState,
    ) -> f64 {
        let difference = (state.stress - self.stress(l, p)).norm();
        if asleep {
            return difference;
        }
        let right = difference <= RIGHT * p.sleep_stress * state.stress.norm();
        let apart = state.coordination == 0.0 && state.relative_overlap == 0.0;
        self.settled = (right || apart) && !state.thin && !state.dense;
        self.slept = false;
        self.coordination = state.coordination;
        self.fabric = fabric(p, state.coordination, state.solid_fraction);
        self.base = state.stress - self.answer(&strain_rate(l), dashpots(p));
        self.deformation = Matrix2::identity();
        0.0
    }

    /// Forgets all: a fresh packing takes the place.
    pub(crate) fn wake(&mut self) {
        *self = Self { audited: self.audited, ..Self::default() };
    }

    /// Whether the deformation leaves the stress nearly as it was, or contacts open.
    fn is_quiet(&self, p: &RveParameters) -> bool {
        let (rotation, strain) = polar(&self.deformation);
        if rotation.m21.abs() > LARGEST_TURN {
            return false;
        }
        if self.coordination == 0.0 {
            // Principal strains.
            let half = 0.5 * strain.trace();
            let deviator = (half * half - strain.determinant()).max(0.0).sqrt();
            return half - deviator >= -LARGEST_CLOSING && half + deviator <= LARGEST_OPENING;
        }
        self.answer(&strain, springs(p)).norm() <= p.sleep_stress * self.base.norm()
    }

    /// Stress (Pa) of springs under a strain, or of dashpots under its rate (1/s).
    fn answer(&self, strain: &Matrix2<f64>, moduli: Moduli) -> Matrix2<f64> {
        let half = Matrix2::identity() * (0.5 * strain.trace());
        -(half * (2.0 * moduli.bulk) + (strain - half) * (2.0 * moduli.shear)) * self.fabric
    }
}

fn strain_rate(l: &Matrix2<f64>) -> Matrix2<f64> {
    0.5 * (l + l.transpose())
}

/// Rotation `R` and strain `U - I` of `F = R U`.
fn polar(f: &Matrix2<f64>) -> (Matrix2<f64>, Matrix2<f64>) {
    let (c, s) = (f.m11 + f.m22, f.m21 - f.m12);
    let r = c.hypot(s);
    let rotation = Matrix2::new(c, -s, s, c) / r;
    (rotation, rotation.transpose() * f - Matrix2::identity())
}
