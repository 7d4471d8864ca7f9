//! A block on a rough floor in tilted gravity, against Coulomb's law.

mod common;

use common::*;
use mpm::{Basis, Domain, Friction, Numerics, Points, Solver, Vec2, WallContact, Walls};
use rstest::rstest;

/// Mean velocity and mean displacement of a block on a floor of friction `mu` inclined by `angle`
/// (degrees) after `time`; x points down the slope.
fn slide(
    numerics: Numerics,
    angle: f64,
    friction: Friction,
    time: f64,
    dt: f64,
    length: f64,
    young: f64,
) -> (f64, f64) {
    let (sin, cos) = angle.to_radians().sin_cos();
    let walls = Walls { bottom: friction, ..Walls::default() };
    let domain = Domain { size: Vec2::new(length, 1.0), walls, cell: 0.1 };
    let gravity = Vec2::new(sin, -cos) * GRAVITY;
    let mut solver = Solver::new(domain, numerics, gravity, vec![]).unwrap();
    let mut points = Points::rectangle(Vec2::new(0.5, 0.0), Vec2::new(0.9, 0.2), 0.05, 1800.0);
    let mut material = elastic(young, 0.0);
    let start = centre_of_mass(&points).x;
    for _ in 0..(time / dt).round() as usize {
        solver.advance(&mut points, &mut material, dt).unwrap();
    }
    let budget = solver.budget(&points);
    (budget.momentum.x / budget.mass, centre_of_mass(&points).x - start)
}

/// `v = g (sin - mu cos) t`; on a slope of 30 degrees after 0.1 s: 0.4905 m/s without and
/// 0.40554 m/s with a friction of 0.1 (benchmark of the CB-Geo MPM code).
#[rstest]
fn a_sliding_block_accelerates_as_coulomb_says(
    #[values(Basis::Linear, Basis::Gimp, Basis::Quadratic, Basis::Cubic)] basis: Basis,
    #[values(WallContact::Nodes, WallContact::Points)] wall_contact: WallContact,
) {
    let numerics = Numerics { basis, wall_contact, ..Numerics::default() };
    for (friction, expected) in [(Friction::Slip, 0.4905), (Friction::Coulomb(0.1), 0.40554)] {
        let (v, _) = slide(numerics, 30.0, friction, 0.1, 1.0e-4, 3.0, 1.0e8);
        println!("{basis:?} {wall_contact:?} {friction:?}: {v:.5} m/s of {expected}");
        assert!((v / expected - 1.0).abs() < 0.01);
    }
}

/// Below the angle of friction, and on a floor that sticks, the block stays.
#[rstest]
#[case(Friction::Coulomb(0.7))]
#[case(Friction::Stick)]
fn a_block_below_the_angle_of_friction_stays(#[case] friction: Friction) {
    let (v, x) = slide(Numerics::default(), 30.0, friction, 0.5, 1.0e-4, 3.0, 1.0e7);
    println!("{friction:?}: {v:.2e} m/s, {x:.2e} m");
    // At first the block bounces (gravity is sudden) and slips whenever its weight is off the floor.
    assert!(x.abs() < 1.0e-3 && v.abs() < 1.0e-5);
}

/// Slope of 24 degrees, friction tan 15 degrees, 5 s: `(g t² / 2)(sin - mu cos) = 19.8595 m`
/// (benchmark of the MPM code Matter).
#[test]
fn a_block_slides_twenty_metres_down_a_plane() {
    let mu = 15.0_f64.to_radians().tan();
    let (_, x) = slide(Numerics::default(), 24.0, Friction::Coulomb(mu), 5.0, 1.0e-3, 22.0, 2.0e6);
    println!("{x:.4} m of 19.8595");
    assert!((x / 19.8595 - 1.0).abs() < 1.0e-3);
}
