//! What the velocity transfer dissipates.

mod common;

use std::f64::consts::PI;

use common::*;
use mpm::{Basis, Numerics, Points, Scheme, Transfer, Vec2};
use rstest::rstest;

/// Decay rate (1/s) of the shear wave `v_x = sin(k y)` in material without stress.
fn shear_decay(basis: Basis, transfer: Transfer, dt: f64, cells_per_wave: f64) -> f64 {
    let cell = 0.1;
    let height = 12.0 * cells_per_wave * cell;
    let numerics = Numerics { basis, scheme: Scheme::Usl, transfer, ..Numerics::default() };
    let mut solver = smooth_box(Vec2::new(2.0, height), cell, numerics, Vec2::zeros());
    let mut points =
        Points::rectangle(Vec2::new(0.8, 0.0), Vec2::new(1.2, height), cell / 2.0, 1.0);
    let k = 2.0 * PI / (cells_per_wave * cell);
    // Small: points stay where they are.
    let v0 = 1.0e-6;
    for p in 0..points.len() {
        let y = points.position[p].y;
        points.velocity[p].x = v0 * (k * y).sin();
        points.affine[p][(0, 1)] = v0 * k * (k * y).cos();
    }
    // Two waves in the middle, far from the walls.
    let amplitude = |points: &Points| {
        let middle = |y: f64| (y - 0.5 * height).abs() < cells_per_wave * cell;
        points
            .position
            .iter()
            .zip(&points.velocity)
            .filter(|(x, _)| middle(x.y))
            .map(|(x, v)| v.x * (k * x.y).sin())
            .sum::<f64>()
    };
    let start = amplitude(&points);
    let steps = 20;
    for _ in 0..steps {
        solver.advance(&mut points, &mut Dust, dt).unwrap();
    }
    (start / amplitude(&points)).ln() / (steps as f64 * dt)
}

/// P2G and G2P spread velocity with the variance `dx²/4` each (quadratic splines), `dx²/2` a step:
/// a viscosity `nu = s dx² / 4 dt` for a PIC share s. With the share given as a rate, `s = beta dt`,
/// it is `beta dx² / 4` whatever the step.
#[rstest]
#[case(1.0e-3)]
#[case(5.0e-4)]
#[case(1.0e-4)]
fn pic_viscosity_is_set_by_the_rate_and_not_by_the_step(#[case] dt: f64) {
    let (rate, cells) = (100.0, 40.0);
    let k = 2.0 * PI / (cells * 0.1);
    let expected = rate * 0.01 / 4.0 * k * k;
    let measured = shear_decay(Basis::Quadratic, Transfer::Flip { rate }, dt, cells);
    println!("dt {dt}: {measured:.4e} 1/s, nu k² = {expected:.4e}");
    // Fourth-order terms: (k dx)² / 4 ~ 0.6 %; the decay in a step is not infinitesimal: another.
    assert!((measured / expected - 1.0).abs() < 0.02);
}

/// APIC and the default transfer carry a linear velocity field without loss; what is left is of
/// fourth order in `k dx`, and for APIC it grows as `1 / dt`.
#[test]
fn affine_transfers_dissipate_far_less() {
    let dt = 1.0e-4;
    let rates = [Transfer::Pic, Transfer::Apic, Transfer::default(), Transfer::Flip { rate: 0.0 }]
        .map(|t| shear_decay(Basis::Quadratic, t, dt, 20.0));
    println!(
        "PIC {:.3e}, APIC {:.3e}, default {:.3e}, FLIP {:.3e} 1/s",
        rates[0], rates[1], rates[2], rates[3]
    );
    assert!(rates[1] < 0.1 * rates[0]);
    assert!(rates[2] < 0.1 * rates[1]);
    assert!(rates[3].abs() < 1.0e-3 * rates[1]);
}
