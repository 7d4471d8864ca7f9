//! D8. A consolidated packing is in equilibrium, and its stress is the virial of its contacts.

use dem::Rve;
use nalgebra::{Matrix2, Vector2};
use rstest::rstest;

use crate::common::{DENSE, LOOSE, MEDIUM, expect, packing, parameters, stepwise};

/// `s_xx = s_yy = p` to the servo's 1e-3; forces and torques on the discs balance; the stress is
/// symmetric and does not depend on which disc of a pair comes first or on its image.
#[rstest]
#[case(DENSE)]
#[case(MEDIUM)]
#[case(LOOSE)]
fn an_isotropic_packing_balances(#[case] friction: f64) {
    let pressure = 20.0e3;
    let p = parameters(pressure, friction);
    let mut element = stepwise(packing(&p, 1), &p);
    crate::common::settle(&mut element, 0.1);
    let s = element.state.stress / pressure;
    expect("sxx / p", s[(0, 0)], 1.0, 2e-3);
    expect("syy / p", s[(1, 1)], 1.0, 2e-3);

    let mut virial = Matrix2::zeros();
    let mut mean_normal = 0.0;
    let mut forces = vec![Vector2::<f64>::zeros(); p.discs];
    let mut torques = vec![0.0_f64; p.discs];
    let packing = &element.rve.packing;
    for c in packing.contacts() {
        let n = c.branch.normalize();
        let f =
            n * (p.grains.normal_stiffness * c.overlap) + Vector2::new(-n.y, n.x) * c.tangential;
        virial += f * c.branch.transpose();
        mean_normal += p.grains.normal_stiffness * c.overlap;
        forces[c.i] -= f;
        forces[c.j] += f;
        torques[c.i] -= c.tangential * (packing.discs[c.i].r - 0.5 * c.overlap);
        torques[c.j] -= c.tangential * (packing.discs[c.j].r - 0.5 * c.overlap);
    }
    mean_normal /= packing.contacts().count() as f64;
    let total: Vector2<f64> = forces.iter().sum();
    assert!(total.norm() < 1e-12 * mean_normal * p.discs as f64, "momentum is not conserved");
    let unbalanced = forces.iter().map(|f| f.norm()).sum::<f64>() / p.discs as f64 / mean_normal;
    println!("mean resultant / mean normal force: {unbalanced:.1e}");
    assert!(unbalanced < 1e-4);
    let largest_torque = torques.iter().fold(0.0_f64, |m, t| m.max(t.abs()));
    assert!(largest_torque < 1e-3 * mean_normal * p.grains.radius_max);

    let virial = virial / (packing.cell.area() * p.grains.thickness);
    let asymmetry = (virial[(0, 1)] - virial[(1, 0)]).abs() / pressure;
    println!("asymmetry {asymmetry:.1e}");
    assert!(asymmetry < 1e-5);
    let error = (virial - element.state.stress).norm() / pressure;
    assert!(error < 1e-5, "virial differs by {error:.1e}");
}

/// The present stress does not depend on where the cell's origin lies.
#[test]
fn stress_does_not_depend_on_the_origin() {
    let p = parameters(20.0e3, DENSE);
    let mut element = stepwise(packing(&p, 1), &p);
    let mut moved = element.clone();
    for d in &mut moved.rve.packing.discs {
        d.s = [d.s[0].wrapping_add(u64::MAX / 3), d.s[1].wrapping_add(u64::MAX / 7)];
    }
    moved.rve = Rve::new(moved.rve.packing);
    element.advance(&Matrix2::zeros()).unwrap();
    moved.advance(&Matrix2::zeros()).unwrap();
    let error = (element.state.stress - moved.state.stress).norm();
    assert!(error < 1e-9 * element.state.stress.norm(), "{error}");
}
