//! A disc on a rough plane.

use dem::Grains;
use dem::assembly::{Assembly, Boundary, Grain, RigidBox};
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
    resisting(boxed, gravity, speed, 0.0)
}

/// The same with a coefficient of rolling friction.
fn resisting(
    boxed: bool,
    gravity: [f64; 2],
    speed: f64,
    rolling_friction: f64,
) -> (Grains, Assembly<f64>) {
    let p = Grains { damping_ratio: 0.5, rolling_friction, ..accurate() };
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

/// With rolling resistance on a slope of angle a: it stays where tan a < mu_r, by the balance of moments about the
/// contact, m g r sin a = mu_r r m g cos a; otherwise it rolls with 2/3 g (sin a - mu_r cos a).
#[rstest]
fn stays_or_rolls_down_a_slope(
    #[values(false, true)] boxed: bool,
    #[values(0.05, 0.09, 0.11, 0.3)] tangent: f64,
) {
    let (mu, angle) = (0.1, f64::atan(tangent));
    let gravity = [G * angle.sin(), -G * angle.cos()];
    let (p, mut disc) = resisting(boxed, gravity, 0.0, mu);
    advance(&mut disc, 0.1);
    let state = disc.states()[0];
    if tangent < mu {
        // The springs give way by less than the weight over their stiffness, 2e-7 m.
        expect("way", state.x[0] - 0.5, 0.0, 1.0e-6);
        expect("spin", state.w * p.radius_max, 0.0, 1.0e-6);
    } else {
        let acceleration = 2.0 / 3.0 * (angle.sin() - mu * angle.cos());
        expect("acceleration over g", state.v[0] / (0.1 * G), acceleration, 2.0e-3);
    }
}

/// A rolling disc loses 2/3 mu_r g t of its speed until it rests, and all of its energy 3/4 m v0² by rolling.
#[rstest]
fn comes_to_rest(#[values(false, true)] boxed: bool) {
    let (mu, speed) = (0.1, 0.2);
    let p = Grains { damping_ratio: 0.5, rolling_friction: mu, ..accurate() };
    let (domain, height) = plane(boxed);
    let r = p.radius_max;
    let weight = p.disc_mass(r) * G;
    let start = grain([0.5, height + r - weight / p.normal_stiffness], [speed, 0.0], r);
    let start = vec![Grain { w: -speed / r, ..start }];
    let mut disc: Assembly<f64> = assembly(&p, &domain, [0.0, -G], start);
    let before = disc.energy();
    let until = speed / (2.0 / 3.0 * mu * G);
    advance(&mut disc, 0.5 * until);
    expect("half speed", disc.states()[0].v[0] / speed, 0.5, 2.0e-3);
    advance(&mut disc, 0.6 * until);
    let state = disc.states()[0];
    expect("rest", state.v[0] / speed, 0.0, 1.0e-3);
    // v0² / (2 a)
    expect("way", (state.x[0] - 0.5) / (0.5 * speed * until), 1.0, 5.0e-3);
    let kinetic = 0.75 * p.disc_mass(r) * speed * speed;
    let energy = disc.energy();
    expect("loss", (energy.losses.friction - before.losses.friction) / kinetic, 1.0, 5.0e-3);
    expect("budget", (energy.total() - before.total()) / kinetic, 0.0, 1.0e-3);
}
