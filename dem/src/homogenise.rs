//! Homogenised stress of a packing: Love-Weber contact part plus kinetic part.

use nalgebra::Matrix2;

use crate::contact::ContactSums;
use crate::packing::Packing;
use crate::real::Real;

/// Cauchy stress (Pa), compression positive, symmetrised:
/// `sigma = (sum_c f (x) l + sum_i m u (x) u) / (A t)`.
///
/// The kinetic part matters only above an inertial number of about 0.1.
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

/// Inertial number `I = gamma d sqrt(rho_s / p)` with the shear rate
/// `gamma = sqrt(2 dev D : dev D)` of a velocity gradient (1/s), at pressure `p` (Pa).
/// Zero at rest, infinite for motion without pressure.
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
