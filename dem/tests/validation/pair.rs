//! Two discs, and one disc on a plane: the contact law against closed forms (D1 to D4).

use std::f64::consts::PI;

use dem::element::Element;
use dem::{
    Cell, ContactLaw, Forces, Grains, Packing, PlainDisc, Real, RveParameters, contact_forces,
};
use nalgebra::{Matrix2, Vector2};
use rstest::rstest;

use crate::common::{expect, stepwise};

const R: f64 = 3.75e-3;

/// Equal discs of 3.75 mm, without friction or damping, in steps of 0.02 sqrt(m / kn).
fn parameters() -> RveParameters {
    RveParameters {
        grains: Grains {
            radius_min: R,
            radius_max: R,
            friction: 0.0,
            damping_ratio: 0.0,
            step_factor: 0.02,
            ..Grains::default()
        },
        discs: 2,
        free_solid_fraction: 0.0,
        ..RveParameters::default()
    }
}

/// Disc 0 left of disc 1, just touching, with opposite velocities: `normal` approaching and
/// `tangential` sliding relative velocity (m/s).
fn collide(p: &RveParameters, normal: f64, tangential: f64) -> Element<f64> {
    let disc = |x: f64| PlainDisc { x: [x, 0.05], r: R };
    let discs = [disc(0.05), disc(0.05 + 2.0 * R)];
    let mut packing = Packing::new(Cell::square(0.1), &discs, |r| p.grains.disc_mass(r));
    packing.discs[0].u = [0.5 * normal, -0.5 * tangential];
    packing.discs[1].u = [-0.5 * normal, 0.5 * tangential];
    stepwise(packing, p)
}

fn overlap(element: &Element<f64>) -> f64 {
    let discs = element.rve.packing.plain_discs();
    let [a, b] = [0, 1].map(|k: usize| Vector2::from(discs[k].x));
    2.0 * R - (b - a).norm()
}

/// Steps until the discs separate: contact time, by linear interpolation of the overlap, and the
/// largest overlap.
fn until_separated(element: &mut Element<f64>) -> (f64, f64) {
    let mut largest: f64 = 0.0;
    let mut before = 0.0;
    loop {
        element.advance(&Matrix2::zeros()).unwrap();
        let now = overlap(element);
        largest = largest.max(now);
        if now < 0.0 {
            return (element.t - element.macro_step * now / (now - before), largest);
        }
        before = now;
        assert!(element.t < 0.01, "the discs stick together");
    }
}

fn relative_velocity(element: &Element<f64>) -> [f64; 2] {
    let discs = &element.rve.packing.discs;
    [0, 1].map(|k| discs[1].u[k] - discs[0].u[k])
}

/// D1. Half an oscillation of `m_eff = m / 2` on `kn`: contact time `pi sqrt(m_eff / kn)`,
/// restitution 1, largest overlap `v sqrt(m_eff / kn)`.
#[test]
fn head_on_impact_is_half_an_oscillation() {
    let p = parameters();
    let mass = p.grains.disc_mass(R);
    expect("mass (kg)", mass, 8.781e-4, 1e-7);
    let v = 0.1;
    let mut pair = collide(&p, v, 0.0);
    let (time, largest) = until_separated(&mut pair);
    let period = (0.5 * mass / p.grains.normal_stiffness).sqrt();
    expect("contact time / theory", time / (PI * period), 1.0, 5e-3);
    expect("contact time (s)", time, 2.0816e-4, 5e-3 * 2.0816e-4);
    expect("overlap / theory", largest / (v * period), 1.0, 5e-3);
    expect("restitution", relative_velocity(&pair)[0] / v, 1.0, 5e-3);
}

/// D2. Dashpot without attraction (Schwager and Pöschel 2007):
/// `e = exp(-(zeta / s)(pi - atan2(2 zeta s, 1 - 2 zeta²)))`, `s = sqrt(1 - zeta²)`.
#[rstest]
#[case(0.05, 0.859)]
#[case(0.1, 0.744)]
#[case(0.2, 0.572)]
#[case(0.5, 0.299)]
fn dashpot_restitution(#[case] zeta: f64, #[case] quoted: f64) {
    let s = (1.0 - zeta * zeta).sqrt();
    let formula = (-(zeta / s) * (PI - f64::atan2(2.0 * zeta * s, 1.0 - 2.0 * zeta * zeta))).exp();
    expect("formula", formula, quoted, 1e-3);
    let p = RveParameters {
        grains: Grains { damping_ratio: zeta, ..parameters().grains },
        ..parameters()
    };
    let mut pair = collide(&p, 0.1, 0.0);
    until_separated(&mut pair);
    expect("restitution / formula", relative_velocity(&pair)[0] / 0.1 / formula, 1.0, 0.01);
}

/// D2. Cundall damping takes `alpha` of the force on the way in and gives it back on the way out:
/// `e = sqrt((1 - alpha) / (1 + alpha))`.
#[rstest]
#[case(0.1, 0.905)]
#[case(0.2, 0.816)]
#[case(0.5, 0.577)]
#[case(0.7, 0.420)]
fn local_damping_restitution(#[case] alpha: f64, #[case] quoted: f64) {
    let p = RveParameters {
        grains: Grains { local_damping: alpha, ..parameters().grains },
        ..parameters()
    };
    let mut pair = collide(&p, 0.1, 0.0);
    until_separated(&mut pair);
    let formula = ((1.0 - alpha) / (1.0 + alpha)).sqrt();
    expect("formula", formula, quoted, 1e-3);
    expect("restitution / formula", relative_velocity(&pair)[0] / 0.1 / formula, 1.0, 0.01);
}

/// D3. Gross sliding. With the normal impulse `P = (1 + e) m_eff v_n`, friction gives `mu P` as
/// long as the contact slides throughout (`v_t > 3 mu (1 + e) v_n` for discs): velocities change
/// by `mu P / m`, spins by `mu P r / J`, the slip by `6 mu P / m`.
#[test]
fn oblique_impact_with_sliding() {
    let p =
        RveParameters { grains: Grains { friction: 0.3, ..parameters().grains }, ..parameters() };
    let (m, j) = (p.grains.disc_mass(R), 0.5 * p.grains.disc_mass(R) * R * R);
    // Slow, so that the contact turns little while the discs slide past each other.
    let vn = 0.01;
    let vt = 1.5 * 3.0 * p.grains.friction * 2.0 * vn;
    let mut pair = collide(&p, vn, vt);
    until_separated(&mut pair);
    let impulse = p.grains.friction * 2.0 * 0.5 * m * vn;
    let d = pair.rve.packing.discs.clone();
    expect("tangential velocity", (vt - (d[1].u[1] - d[0].u[1])) / (2.0 * impulse / m), 1.0, 0.01);
    for disc in &d {
        expect("spin", disc.w / (impulse * R / j), 1.0, 0.01);
    }
    let slip = d[1].u[1] - d[0].u[1] - R * (d[0].w + d[1].w);
    expect("slip", (vt - slip) / (6.0 * impulse / m), 1.0, 0.01);
}

/// D3. Sticking: the slip oscillates on `kt` with `omega_t = sqrt(6 kt / m)` for half a normal
/// period `pi / sqrt(2 kn / m)`, so `v_t' = v_t cos(pi sqrt(3 kt / kn))`, and no energy is lost.
#[rstest]
#[case(1.0)]
#[case(0.5)]
#[case(0.25)]
fn oblique_impact_without_sliding(#[case] ratio: f64) {
    let base = parameters();
    let tangential_stiffness = ratio * base.grains.normal_stiffness;
    let p = RveParameters {
        grains: Grains { friction: 1e6, tangential_stiffness, ..base.grains },
        ..base
    };
    let (vn, vt) = (0.1, 0.02);
    let mut pair = collide(&p, vn, vt);
    until_separated(&mut pair);
    let d = &pair.rve.packing.discs;
    let slip = d[1].u[1] - d[0].u[1] - R * (d[0].w + d[1].w);
    expect("slip / v_t", slip / vt, (PI * (3.0 * ratio).sqrt()).cos(), 0.02);
    let m = p.grains.disc_mass(R);
    // At release the tangential spring may still hold energy; it goes with the contact.
    let release = 0.5 * (m / 6.0) * (vt * vt - slip * slip);
    let kinetic = pair.rve.packing.kinetic_energy();
    expect("energy", (kinetic + release) / (0.25 * m * (vn * vn + vt * vt)), 1.0, 0.01);
}

/// D4. A disc on a plane inclined by `theta`, from rest. It rolls with `a = 2/3 g sin theta` while
/// `tan theta < 3 mu`, and otherwise slides with `a = g (sin - mu cos)` and spins up with
/// `2 mu g cos / r`. The plane is a fixed disc of radius 1 km; gravity is added here.
#[rstest]
#[case::rolls(20.0, 0.5)]
#[case::just_rolls(50.0, 0.5)]
#[case::slides(60.0, 0.5)]
#[case::slides_on_low_friction(30.0, 0.1)]
fn disc_on_an_incline(#[case] degrees: f64, #[case] mu: f64) {
    let p = RveParameters {
        grains: Grains {
            friction: mu,
            damping_ratio: 0.2,
            step_factor: 0.1,
            ..parameters().grains
        },
        ..parameters()
    };
    let theta = f64::to_radians(degrees);
    let (g, m) = (9.81, p.grains.disc_mass(R));
    let gravity = Vector2::new(g * theta.sin(), -g * theta.cos());
    let plane = 1.0e3;
    let cell = Cell::square(4.0 * plane);
    let sunk = m * g * theta.cos() / p.grains.normal_stiffness;
    let discs = [
        PlainDisc { x: [2.0 * plane, plane], r: plane },
        PlainDisc { x: [2.0 * plane, 2.0 * plane + R - sunk], r: R },
    ];
    let packing = Packing::<f64>::new(cell, &discs, |r| p.grains.disc_mass(r));
    // One step at rest lists the pair.
    let dt = p.grains.step();
    let mut packing = {
        let mut element = stepwise(packing, &p);
        element.advance(&Matrix2::zeros()).unwrap();
        element.rve.packing
    };
    let law = ContactLaw::new(&p.grains, dt);
    let mut forces = Forces::<f64>::default();
    let steps = (0.1 / dt) as usize;
    packing.discs[1].u = [0.0; 2];
    packing.discs[1].w = 0.0;
    for _ in 0..steps {
        contact_forces(&mut packing, &law, &Matrix2::zeros(), &mut forces);
        let force = forces.on_disc[1];
        let d = &mut packing.discs[1];
        let f = Vector2::new(force[0], force[1]) * d.inv_mass + gravity;
        for k in 0..2 {
            d.u[k] += f[k] * dt;
            d.s[k] = f64::advance(d.s[k], d.u[k] * dt / (4.0 * plane) / f64::UNIT);
        }
        d.w += force[2] * d.inv_inertia * dt;
    }
    let t = steps as f64 * dt;
    let d = &packing.discs[1];
    let rolls = theta.tan() < 3.0 * mu;
    let (a, spin) = if rolls {
        let a = 2.0 / 3.0 * g * theta.sin();
        (a, a / R)
    } else {
        (g * (theta.sin() - mu * theta.cos()), 2.0 * mu * g * theta.cos() / R)
    };
    expect("acceleration / theory", d.u[0] / t / a, 1.0, 5e-3);
    expect("angular acceleration / theory", -d.w / t / spin, 1.0, 5e-3);
}
