//! Bounds on the step.

use crate::grid::Shape;
use crate::stencil::{self, Stencil};
use crate::{Error, Material, Numerics, Points, Scheme};

/// How large a step may be in the present state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StableStep {
    /// Lower bound of the critical step (s), `2 / omega_max` (`sqrt 2 / omega_max` under USL) with the
    /// grid's largest frequency bounded by Gershgorin's theorem. On `m^-1/2 K m^-1/2`, the row of node i sums up to at most
    ///
    /// ```text
    /// omega² <= max_i sum_p V_p M_p b_ip sum_j b_jp,   b_ip = |grad S_ip| / sqrt(m_i)
    /// ```
    ///
    /// Rows of `m^-1 K` bound it as well, but without limit as a node of a spline becomes light:
    /// there gradients vanish as the root of the mass only. The viscosity of shocks lowers it.
    pub gershgorin: f64,
    /// Time in which the fastest signal crosses a cell (s): `min_p cell / (c_p + |v_p|)`,
    /// `c = sqrt(M / rho)`.
    pub cfl: f64,
    /// The point of that minimum.
    pub point: usize,
    /// Largest speed of a point (m/s).
    pub speed: f64,
    /// Largest norm of the strain rate, `sqrt(D : D)` (1/s).
    pub strain_rate: f64,
}

impl StableStep {
    /// Courant number of a step: `dt / cfl`. Half is safe for uGIMP and splines.
    pub fn courant(&self, dt: f64) -> f64 {
        dt / self.cfl
    }
}

pub(crate) fn stable_step(
    shape: &Shape,
    numerics: &Numerics,
    points: &Points,
    material: &dyn Material,
) -> Result<StableStep, Error> {
    let cutoff = numerics.cutoff(points.check(shape)?, points.len());
    let mut result = StableStep {
        gershgorin: gershgorin(shape, numerics, cutoff, points, material),
        cfl: f64::INFINITY,
        point: 0,
        speed: 0.0,
        strain_rate: 0.0,
    };
    for p in 0..points.len() {
        let speed = points.velocity[p].norm();
        let wave_speed = (material.wave_modulus(p) / points.density(p)).sqrt();
        let crossing = shape.cell / (wave_speed + speed);
        if crossing < result.cfl {
            result.cfl = crossing;
            result.point = p;
        }
        result.speed = result.speed.max(speed);
        let l = &points.velocity_gradient[p];
        result.strain_rate = result.strain_rate.max(((l + l.transpose()) * 0.5).norm());
    }
    Ok(result)
}

fn gershgorin(
    shape: &Shape,
    numerics: &Numerics,
    cutoff: f64,
    points: &Points,
    material: &dyn Material,
) -> f64 {
    let mut stencils = Vec::new();
    stencil::evaluate(numerics.basis, shape, &points.position, &mut stencils);
    let (columns, width) = (shape.columns, numerics.basis.width());
    let support = || (0..width).flat_map(|b| (0..width).map(move |a| (a, b)));
    let node = |stencil: &Stencil, a: usize, b: usize| stencil.node + b * columns + a;

    let mut mass = vec![0.0; columns * shape.rows];
    for (stencil, m) in stencils.iter().zip(&points.mass) {
        for (a, b) in support() {
            mass[node(stencil, a, b)] += m * stencil.value(a, b);
        }
    }
    // Of the stiffness and of the viscosity of shocks.
    let mut row_sums = vec![[0.0; 2]; mass.len()];
    let shock_width = numerics.shock_width * shape.cell;
    for (p, stencil) in stencils.iter().enumerate() {
        let weight = |(a, b): (usize, usize)| {
            let m: f64 = mass[node(stencil, a, b)];
            if m > cutoff { stencil.gradient(a, b).norm() / m.sqrt() } else { 0.0 }
        };
        let total: f64 = support().map(weight).sum();
        let stiffness = points.volume[p] * material.wave_modulus(p);
        let compression = (-points.velocity_gradient[p].trace()).max(0.0);
        let viscosity = points.mass[p] * shock_width * shock_width * compression;
        for (a, b) in support() {
            let row = &mut row_sums[node(stencil, a, b)];
            row[0] += stiffness * weight((a, b)) * total;
            row[1] += viscosity * weight((a, b)) * total;
        }
    }
    // A node of stiffness k and viscosity c, which acts on the velocity before the step, is stable while
    // k (dt / phase)² + c dt / 2 <= 1.
    let phase = critical_phase(numerics.scheme);
    let step =
        |[k, c]: &[f64; 2]| 2.0 / (0.5 * c + (0.25 * c * c + 4.0 * k / (phase * phase)).sqrt());
    row_sums.iter().map(step).fold(f64::INFINITY, f64::min)
}

/// `omega dt` up to which every mode is stable. Under USL stress sees a velocity of which the points
/// keep a share P only, and the limit of a mode is `2 / sqrt(2 - P)`: that of a single point, P = 0,
/// is a root of two.
fn critical_phase(scheme: Scheme) -> f64 {
    match scheme {
        Scheme::Usl => std::f64::consts::SQRT_2,
        Scheme::Musl | Scheme::Usf => 2.0,
    }
}
