//! Patch test: a uniform stress must not push on nodes inside a body, wherever its points are.

mod common;

use common::*;
use mpm::{Basis, Mat2, Points, Scheme, Vec2};

/// Largest acceleration kick of points well inside a block under uniform stress, over
/// `sigma / (rho cell)`, the natural scale. The block's lattice of points is stretched by `stretch`
/// and moved by `shift` cells.
fn spurious_force(basis: Basis, stretch: f64, shift: f64) -> f64 {
    let (cell, density, sigma, dt) = (0.1, 1000.0, 1.0e4, 1.0e-6);
    let mut solver = smooth_box(Vec2::new(4.0, 4.0), cell, flip(basis, Scheme::Usl), Vec2::zeros());
    let corner = Vec2::new(1.0 + shift * cell, 1.0 + shift * cell);
    let side = 1.5 * stretch;
    let mut points =
        Points::rectangle(corner, corner + Vec2::new(side, side), 0.5 * cell * stretch, density);
    points.stress.fill(Mat2::identity() * -sigma);
    solver.advance(&mut points, &mut Dust, dt).unwrap();
    let inside =
        |x: &Vec2| (x - corner).min() > 4.0 * cell && (x - corner).max() < side - 4.0 * cell;
    let kick = points
        .position
        .iter()
        .zip(&points.velocity)
        .filter(|(x, _)| inside(x))
        .map(|(_, v)| v.norm())
        .fold(0.0, f64::max);
    kick / dt / (sigma / (density * cell))
}

/// A lattice at the spacing the grid expects is in equilibrium wherever it lies: two points a cell
/// integrate the gradients of all these functions exactly, unless points sit on the kinks of the
/// linear basis.
#[test]
fn an_aligned_block_is_in_equilibrium_at_any_shift() {
    for basis in [Basis::Linear, Basis::Gimp, Basis::Quadratic, Basis::Cubic] {
        for shift in [0.0, 0.1, 0.37, 0.73] {
            let force = spurious_force(basis, 1.0, shift);
            assert!(force < 1.0e-9, "{basis:?} at {shift}: {force}");
        }
    }
}

/// Once the lattice is stretched, points have crossed cell faces, and some cells of the linear basis
/// hold one point or three: nodal forces of the order of sigma. Smooth functions err by their
/// quadrature only.
#[test]
fn a_stretched_block_kicks_only_the_linear_basis_hard() {
    let worst = |basis| {
        [0.0, 0.2, 0.4, 0.6, 0.8]
            .map(|s| spurious_force(basis, 1.1, s))
            .into_iter()
            .fold(0.0, f64::max)
    };
    let [linear, gimp, quadratic, cubic] =
        [Basis::Linear, Basis::Gimp, Basis::Quadratic, Basis::Cubic].map(worst);
    println!("linear {linear:.3}, uGIMP {gimp:.3}, quadratic {quadratic:.4}, cubic {cubic:.5}");
    assert!(linear > 0.2);
    assert!(gimp < 0.5 * linear);
    assert!(quadratic < 0.2 * linear);
    assert!(cubic < 0.1 * linear);
}
