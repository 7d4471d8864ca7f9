//! A stack of discs at rest under its weight.

use dem::assembly::RigidBox;
use rstest::rstest;

use crate::common::{G, accurate, advance, assembly, expect, faces, flat, grain, with_box};

const DISCS: usize = 5;

/// The k-th contact from the free end carries k discs: its overlap is k m g / kn. On the floor, on a box, and
/// sideways between a wall and nothing.
#[rstest]
#[case::floor([0.0, -G], 0.0)]
#[case::on_box([0.0, -G], 0.02)]
#[case::left_wall([-G, 0.0], 0.0)]
#[case::beside_box([-G, 0.0], 0.02)]
fn overlaps(#[case] gravity: [f64; 2], #[case] base: f64) {
    let p = accurate();
    let r = p.radius_max;
    let axis = usize::from(gravity[1] != 0.0);
    let place = |s: f64| if axis == 1 { [0.1, s] } else { [s, 0.1] };
    let start = (0..DISCS).map(|k| grain(place(base + (2 * k + 1) as f64 * r), [0.0; 2], r));
    let far = f64::INFINITY;
    let corner = if axis == 1 { [0.15, base] } else { [base, 0.15] };
    let mut domain = flat([0.2, 0.2], 0.5);
    if base > 0.0 {
        domain = with_box(domain, RigidBox::fixed([-far, -far], corner, faces(0.5)));
    }
    let mut stack = assembly::<f64>(&p, &domain, gravity, start.collect());
    stack.set_drag(1.0e3);
    advance(&mut stack, 0.1);
    let positions: Vec<f64> = stack.states().iter().map(|s| s.x[axis]).collect();
    let unit = p.disc_mass(r) * G / p.normal_stiffness;
    expect("base", (r - (positions[0] - base)) / unit, DISCS as f64, 1.0e-3);
    for k in 1..DISCS {
        let overlap = 2.0 * r - (positions[k] - positions[k - 1]);
        expect("overlap", overlap / unit, (DISCS - k) as f64, 1.0e-3);
    }
    // Love-Weber over the lowest disc: m g times the weights above and below it, times its radius.
    let virial = stack.states()[0].virial[(axis, axis)];
    let expected = p.disc_mass(r) * G * r * (2 * DISCS - 1) as f64;
    expect("virial", virial / expected, 1.0, 1.0e-3);
}

/// A disc squeezed between a box and a wall by its weight along a slope of 45 degrees: each carries
/// m g / sqrt 2.
#[test]
fn between_box_and_wall() {
    let p = accurate();
    let r = p.radius_max;
    let ledge = RigidBox::fixed([0.0, 0.0], [0.05, 0.05], faces(0.0));
    let gravity = [-G / 2.0_f64.sqrt(), -G / 2.0_f64.sqrt()];
    let start = vec![grain([r, 0.05 + r], [0.0; 2], r)];
    let mut disc = assembly::<f64>(&p, &with_box(flat([0.2, 0.2], 0.5), ledge), gravity, start);
    disc.set_drag(1.0e3);
    advance(&mut disc, 0.05);
    let x = disc.states()[0].x;
    let expected = p.disc_mass(r) * G / 2.0_f64.sqrt() / p.normal_stiffness;
    expect("wall", (r - x[0]) / expected, 1.0, 1.0e-3);
    expect("box", (r - (x[1] - 0.05)) / expected, 1.0, 1.0e-3);
}
