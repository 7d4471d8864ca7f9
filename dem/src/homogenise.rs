//! Homogenised stress of a packing, and its inertial number.

use nalgebra::Matrix2;

use crate::contact::ContactSums;
use crate::packing::Packing;
use crate::real::Real;

/// Cauchy stress (Pa), compression positive: the symmetric part of
///
/// $$ \boldsymbol\sigma = \frac{1}{A t} \left( \sum_c \mathbf f^c \otimes \mathbf l^c
/// + \sum_i m_i \mathbf u_i \otimes \mathbf u_i \right) $$
///
/// with cell area $A$ and `thickness` $t$ (m). The first sum is the formula of Love (1927) and Weber (1966) over
/// contacts; see Christoffersen, Mehrabadi & Nemat-Nasser (1981), J. Appl. Mech. 48, 339. The second, `kinetic`,
/// part matters above an inertial number of about 0.1 only.
pub fn stress<R: Real>(
    packing: &Packing<R>,
    sums: &ContactSums,
    thickness: f64,
    kinetic: bool,
) -> Matrix2<f64> {
    let mut total = Matrix2::from_row_slice(&sums.force_branch);
    if kinetic {
        let [xx, xy, yy] = momentum_flux(packing);
        total += Matrix2::new(xx, xy, xy, yy);
    }
    0.5 * (total + total.transpose()) / (packing.cell.area() * thickness)
}

/// `sum m u (x) u` (J): xx, xy, yy.
fn momentum_flux<R: Real>(packing: &Packing<R>) -> [f64; 3] {
    let mut sum = [R::default(); 3];
    for d in &packing.discs {
        let mass = R::from_f64(1.0) / d.inv_mass;
        let (px, py) = (mass * d.u[0], mass * d.u[1]);
        sum[0] += px * d.u[0];
        sum[1] += px * d.u[1];
        sum[2] += py * d.u[1];
    }
    sum.map(R::to_f64)
}

/// Inertial number $I = \dot\gamma d \sqrt{\rho_s / p}$ (GDR MiDi 2004, Eur. Phys. J. E 14, 341) of grains
/// of `diameter` $d$ (m) and `grain_density` $\rho_s$ (kg/m³) at `pressure` $p$ (Pa), with the shear rate
/// $\dot\gamma = \sqrt{2 \mathbf D' : \mathbf D'}$ of a velocity gradient (1/s) of deviatoric strain rate
/// $\mathbf D'$. Zero at rest, infinite for motion without pressure.
pub fn inertial_number(
    velocity_gradient: &Matrix2<f64>,
    pressure: f64,
    diameter: f64,
    grain_density: f64,
) -> f64 {
    let d = 0.5 * (velocity_gradient + velocity_gradient.transpose());
    let deviator = d - Matrix2::identity() * (0.5 * d.trace());
    let shear_rate = std::f64::consts::SQRT_2 * deviator.norm();
    if shear_rate == 0.0 {
        0.0
    } else {
        shear_rate * diameter * (grain_density / pressure.max(0.0)).sqrt()
    }
}
