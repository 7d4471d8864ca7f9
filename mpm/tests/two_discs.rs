//! Impact of two elastic discs through the grid.

mod common;

use common::*;
use mpm::{Basis, Points, Scheme, Vec2};
use rstest::rstest;

/// Sulsky, Chen & Schreyer (1994), CMAME 118, 179: discs of r = 0.2 m, E = 1000 Pa, nu = 0.3,
/// rho = 1000 kg/m³ meet at 0.1 m/s along the diagonal, bounce off and part. The only contact is
/// the common velocity field.
#[rstest]
fn two_elastic_discs_bounce(
    #[values(Basis::Gimp, Basis::Quadratic)] basis: Basis,
    #[values(Scheme::Musl, Scheme::Usf)] scheme: Scheme,
) {
    let (cell, dt, v0) = (0.05, 2.0e-3, Vec2::new(0.1, 0.1));
    let mut solver = smooth_box(Vec2::new(2.0, 2.0), cell, flip(basis, scheme), Vec2::zeros());
    let mut points = disc(Vec2::new(0.75, 0.75), 0.2, cell / 4.0, 1000.0);
    let half = points.len();
    points.append(disc(Vec2::new(1.25, 1.25), 0.2, cell / 4.0, 1000.0));
    for (p, v) in points.velocity.iter_mut().enumerate() {
        *v = if p < half { v0 } else { -v0 };
    }
    let (young, poisson) = (1000.0, 0.3);
    let mut material = elastic(young, poisson);
    // Plane strain: W = (1 + nu) / 2E (sigma : sigma - nu (tr sigma)²).
    let energy = |points: &Points| -> f64 {
        (0..points.len())
            .map(|p| {
                let s = &points.stress[p];
                let w = (1.0 + poisson) / (2.0 * young)
                    * (s.norm_squared() - poisson * s.trace().powi(2));
                0.5 * points.mass[p] * points.velocity[p].norm_squared() + w * points.volume[p]
            })
            .sum()
    };
    let start = energy(&points);
    let momentum = solver.budget(&points).momentum;
    for _ in 0..(3.6 / dt) as usize {
        solver.advance(&mut points, &mut material, dt).unwrap();
    }
    let mean = |range: std::ops::Range<usize>| {
        let n = range.len() as f64;
        range.map(|p| points.velocity[p]).sum::<Vec2>() / n
    };
    let (a, b) = (mean(0..half), mean(half..points.len()));
    let restitution = (b - a).dot(&v0) / (2.0 * v0.norm_squared());
    let loss = 1.0 - energy(&points) / start;
    let gap = points.position[..half].iter().map(|x| x.x + x.y).fold(f64::MIN, f64::max);
    let gap = points.position[half..].iter().map(|x| x.x + x.y).fold(f64::MAX, f64::min) - gap;
    println!(
        "{basis:?} {scheme:?}: e = {restitution:.3}, energy lost {loss:.3}, gap {:.3} m",
        gap / 2.0_f64.sqrt()
    );
    let change = (solver.budget(&points).momentum - momentum).norm();
    assert!(change < 1.0e-12 * points.mass.iter().sum::<f64>(), "momentum is exact: {change}");
    assert!(restitution > 0.85 && restitution < 1.0);
    assert!(loss.abs() < 0.05);
    assert!(gap > cell, "clean separation");
}
