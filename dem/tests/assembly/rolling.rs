//! A disc on a rough plane.

use dem::Grains;
use dem::assembly::{Assembly, Boundary, RigidBox};
use rstest::rstest;

use crate::common::{G, accurate, advance, assembly, expect, faces, flat, grain, with_box};

const FRICTION: f64 = 0.3;

/// A plane at this height: the floor, or the top of a box.
fn plane(boxed: bool) -> (Boundary, f64) {
    if boxed {
        let obstacle = RigidBox::fixed([0.1, 0.05], [1.9, 0.1], faces(FRICTION));
        (with_box(flat([2.0, 0.2], 0.0), obstacle), 0.1)
    } else {
        (flat([2.0, 0.2], FRICTION), 0.0)
    }
}

/// A disc in equilibrium with gravity on the plane, with a velocity along it.
fn disc(boxed: bool, gravity: [f64; 2], speed: f64) -> (Grains, Assembly<f64>) {
    let p = Grains { damping_ratio: 0.5, ..accurate() };
    let (domain, height) = plane(boxed);
    let r = p.radius_max;
    let overlap = p.disc_mass(r) * -gravity[1] / p.normal_stiffness;
    let start = vec![grain([0.5, height + r - overlap], [speed, 0.0], r)];
    let disc = assembly(&p, &domain, gravity, start);
    (p, disc)
}

/// It slides with -mu g until v0 / (3 mu g), then rolls with 2/3 v0. The tangential spring is not damped, so
/// that velocities go on to vary by mu g sqrt(m / (3 kt)), 2e-4 m/s.
#[rstest]
fn slides_then_rolls(#[values(false, true)] boxed: bool) {
    let speed = 0.6;
    let (p, mut disc) = disc(boxed, [0.0, -G], speed);
    let until = speed / (3.0 * FRICTION * G);
    advance(&mut disc, 0.9 * until);
    expect("sliding", disc.states()[0].v[0], speed - 0.9 * FRICTION * G * until, 1.0e-3 * speed);
    advance(&mut disc, 0.05 * until);
    let state = disc.states()[0];
    let slip = state.v[0] + state.w * p.radius_max;
    expect("slip", slip, 0.05 * speed, 1.0e-3 * speed);
    advance(&mut disc, 0.3 * until);
    let state = disc.states()[0];
    expect("rolling", state.v[0], 2.0 / 3.0 * speed, 1.0e-3 * speed);
    expect("spin", -state.w * p.radius_max, 2.0 / 3.0 * speed, 2.0e-3 * speed);
}

/// Down a slope of angle a: it rolls with 2/3 g sin a, or slides with g (sin a - mu cos a) where
/// tan a > 3 mu.
#[rstest]
#[case(0.5, 2.0 / 3.0 * 0.5_f64.sin())]
#[case(1.0, 1.0_f64.sin() - FRICTION * 1.0_f64.cos())]
fn down_a_slope(#[values(false, true)] boxed: bool, #[case] angle: f64, #[case] acceleration: f64) {
    let gravity = [G * angle.sin(), -G * angle.cos()];
    let (_, mut disc) = disc(boxed, gravity, 0.0);
    advance(&mut disc, 0.1);
    expect("acceleration over g", disc.states()[0].v[0] / (0.1 * G), acceleration, 2.0e-3);
}
