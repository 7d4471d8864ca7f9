//! Collisions of one disc with another one, a wall, a box, a corner and a moving plate.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use dem::Grains;
use dem::assembly::RigidBox;
use rstest::rstest;

use crate::common::{accurate, advance, assembly, expect, faces, flat, grain, with_box};

/// Restitution of a linear spring and dashpot that does not pull (Schwager & Pöschel 2007, Granular Matter 9,
/// 465): exp(-zeta / s (pi - atan(2 zeta s / (1 - 2 zeta²)))) with s = sqrt(1 - zeta²), for zeta² < 1/2.
/// Without the condition on the sign of the force it would be exp(-pi zeta / s).
fn restitution(zeta: f64) -> f64 {
    let s = (1.0 - zeta * zeta).sqrt();
    (-zeta / s * (PI - (2.0 * zeta * s / (1.0 - 2.0 * zeta * zeta)).atan())).exp()
}

fn damped(zeta: f64) -> Grains {
    Grains { damping_ratio: zeta, ..accurate() }
}

/// Head-on, radii of 1 : 2, so that the dashpot has the effective mass. 1e-3: the step is 0.01 sqrt(m / kn).
#[rstest]
#[case(0.0)]
#[case(0.05)]
#[case(0.2)]
#[case(0.5)]
fn two_discs(#[case] zeta: f64) {
    let p = damped(zeta);
    let [a, b] = [p.radius_min, p.radius_max];
    let start = vec![
        grain([0.05, 0.05], [0.3, 0.0], a),
        grain([0.05 + 1.001 * (a + b), 0.05], [-0.1, 0.0], b),
    ];
    let mut pair = assembly::<f64>(&p, &flat([0.2, 0.1], 0.0), [0.0; 2], start);
    advance(&mut pair, 5.0e-3);
    let v = pair.states().iter().map(|s| s.v[0]).collect::<Vec<_>>();
    expect("restitution", (v[1] - v[0]) / 0.4, restitution(zeta), 1.0e-3);
    let [ma, mb] = [a, b].map(|r| p.disc_mass(r));
    expect("momentum", (ma * v[0] + mb * v[1]) / (0.3 * ma - 0.1 * mb), 1.0, 1.0e-12);
}

/// Head-on, the lightest discs in the steps of scenes: in the mean over the moments within a step at which they
/// meet, restitution is that of short steps, and the energy budget closes.
#[rstest]
#[case(0.0)]
#[case(0.2)]
fn long_steps(#[case] zeta: f64) {
    let p = Grains { step_factor: 0.401, damping_ratio: zeta, ..Grains::default() };
    let (r, speed) = (p.radius_min, 0.2);
    let moments = 50;
    let (mut restitutions, mut drift) = (0.0, 0.0);
    for moment in 0..moments {
        let closing = 2.0 * speed * p.step();
        let gap = (1.0 + f64::from(moment) / f64::from(moments)) * closing;
        let start = vec![
            grain([0.05, 0.05], [speed, 0.0], r),
            grain([0.05 + 2.0 * r + gap, 0.05], [-speed, 0.0], r),
        ];
        let mut pair = assembly::<f64>(&p, &flat([0.2, 0.1], 0.0), [0.0; 2], start);
        let before = pair.energy();
        advance(&mut pair, 1.0e-3);
        let states = pair.states();
        restitutions += (states[1].v[0] - states[0].v[0]) / (2.0 * speed);
        drift += (pair.energy().total() - before.total()) / before.kinetic;
    }
    expect("restitution", restitutions / f64::from(moments), restitution(zeta), 0.005);
    expect("budget", drift / f64::from(moments), 0.0, 0.015);
}

/// The dashpot of a wall or a box has the mass of the disc, so restitution is the same.
#[rstest]
fn wall_or_box(
    #[values(0, 1)] axis: usize,
    #[values(-1.0, 1.0)] direction: f64,
    #[values(false, true)] boxed: bool,
) {
    let p = damped(0.2);
    let r = p.radius_max;
    // From the middle of the domain to a wall, or from a wall to the box in the middle.
    let obstacle = RigidBox::fixed([0.09; 2], [0.11; 2], faces(0.3));
    let domain = flat([0.2, 0.2], 0.3);
    let (domain, surface) = if boxed {
        (with_box(domain, obstacle), 0.1 - 0.01 * direction)
    } else {
        (domain, if direction > 0.0 { 0.2 } else { 0.0 })
    };
    let (mut x, mut v) = ([0.1; 2], [0.0; 2]);
    x[axis] = surface - direction * 1.01 * r;
    v[axis] = 0.2 * direction;
    let mut disc = assembly::<f64>(&p, &domain, [0.0; 2], vec![grain(x, v, r)]);
    advance(&mut disc, 5.0e-3);
    let state = disc.states()[0];
    expect("restitution", -state.v[axis] / v[axis], restitution(0.2), 1.0e-3);
    assert_eq!((state.v[1 - axis], state.w), (0.0, 0.0));
}

/// A disc that meets a corner along its diagonal comes back along it.
#[rstest]
fn corner(#[values(-1.0, 1.0)] right: f64, #[values(-1.0, 1.0)] up: f64) {
    let p = damped(0.2);
    let obstacle = RigidBox::fixed([0.09; 2], [0.11; 2], faces(0.5));
    let side = FRAC_1_SQRT_2 * 1.01 * p.radius_max;
    let x = [0.1 + right * (0.01 + side), 0.1 + up * (0.01 + side)];
    let speed = 0.2 * FRAC_1_SQRT_2;
    let start = vec![grain(x, [-right * speed, -up * speed], p.radius_max)];
    let domain = with_box(flat([0.2, 0.2], 0.0), obstacle);
    let mut disc = assembly::<f64>(&p, &domain, [0.0; 2], start);
    advance(&mut disc, 5.0e-3);
    let state = disc.states()[0];
    expect("x", state.v[0] / (right * speed), restitution(0.2), 1.0e-3);
    expect("y", state.v[1] / (up * speed), restitution(0.2), 1.0e-3);
    expect("spin", state.w * p.radius_max / 0.2, 0.0, 1.0e-9);
}

/// A plate of velocity V strikes a disc at rest: the disc leaves with (1 + e) V, the plate's work is
/// (1 + e) m V², and (1 - e²) m V² / 2 of it is lost.
#[test]
fn plate() {
    let p = damped(0.2);
    let (r, speed, e) = (p.radius_max, 0.5, restitution(0.2));
    let mut plate = RigidBox::fixed([0.05, 0.0], [0.06, 0.1], faces(0.5));
    (plate.velocity, plate.start) = ([speed, 0.0], 2.0e-3);
    let start = vec![grain([0.06 + 1.1 * r, 0.05], [0.0; 2], r)];
    let domain = with_box(flat([0.2, 0.1], 0.0), plate);
    let mut disc = assembly::<f64>(&p, &domain, [0.0; 2], start);
    let before = disc.energy();
    advance(&mut disc, 1.9e-3);
    assert_eq!(disc.energy(), before, "nothing moves before the plate does");
    advance(&mut disc, 5.0e-3);
    let scale = p.disc_mass(r) * speed * speed;
    let energy = disc.energy();
    expect("velocity", disc.states()[0].v[0] / speed, 1.0 + e, 2.0e-3);
    expect("work", energy.losses.boxes / scale, 1.0 + e, 2.0e-3);
    expect("loss", energy.losses.dashpots / scale, 0.5 * (1.0 - e * e), 2.0e-3);
    expect("budget", (energy.total() - before.total()) / scale, 0.0, 1.0e-3);
}
