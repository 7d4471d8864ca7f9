//! Energy and momentum.

use dem::assembly::{Assembly, Energy, Losses};
use dem::{Grains, Real};
use rstest::rstest;

use crate::common::{GRAVITY, advance, assembly, column, column_domain, expect, flat, gas};

/// Collapse of a column of 700 discs: what is lost is what it had, to 0.2 % of what is dissipated, in the steps of
/// scenes and in half of these.
#[rstest]
#[case::single(0.0f32)]
#[case::double(0.0f64)]
fn collapse<R: Real>(
    #[case] _precision: R,
    #[values(0.0, 0.2)] rolling_friction: f64,
    #[values(0.201, 0.401)] step_factor: f64,
) {
    let p = Grains { rolling_friction, step_factor, ..Grains::default() };
    let mut scene = Assembly::<R>::new(&p, &column_domain(), GRAVITY, p.step(), column()).unwrap();
    let start = scene.energy();
    advance(&mut scene, 0.4);
    let Energy { kinetic, potential, elastic, losses } = scene.energy();
    let Losses { dashpots, friction, damping, boxes } = losses;
    let released = start.potential - potential;
    println!(
        "released {released:.4} J: kinetic {kinetic:.4}, elastic {:+.5}, dashpots {dashpots:.4}, friction {friction:.4}",
        elastic - start.elastic
    );
    assert_eq!((damping, boxes), (0.0, 0.0));
    for part in [kinetic, dashpots, friction] {
        assert!(part > 0.02 * released && part < 0.9 * released);
    }
    let drift = scene.energy().total() - start.total();
    expect("drift over dissipation", drift / scene.energy().dissipated(), 0.0, 0.002);
}

/// Discs that collide in empty space keep their momentum and angular momentum, to round-off.
#[rstest]
#[case::single(0.0f32, 1.0e-5)]
#[case::double(0.0f64, 1.0e-12)]
fn momentum<R: Real>(
    #[case] _precision: R,
    #[case] tolerance: f64,
    #[values(0.0, 0.2)] rolling_friction: f64,
) {
    let p = Grains { rolling_friction, ..Grains::default() };
    let mut start = gas(&p, [0.4, 0.4], [10, 10], 0.0102, 0.3, 3);
    for grain in &mut start {
        // Towards the middle.
        grain.v = [0, 1].map(|k| grain.v[k] + 10.0 * (0.45 - grain.x[k]));
    }
    let mut scene = assembly::<R>(&p, &flat([1.0, 1.0], 0.5), [0.0; 2], start);
    let sums = |scene: &Assembly<R>| {
        let mut sums = [0.0; 3];
        let mut scale = [0.0; 2];
        for s in scene.states() {
            let [x, y] = s.x.map(|x| x - 0.45);
            let [u, v] = s.v;
            sums[0] += s.mass * u;
            sums[1] += s.mass * v;
            sums[2] += s.mass * (x * v - y * u) + 0.5 * s.mass * s.r * s.r * s.w;
            scale[0] += s.mass * u.hypot(v);
            scale[1] += s.mass * (x.hypot(y) * u.hypot(v) + 0.5 * s.r * s.r * s.w.abs());
        }
        (sums, scale)
    };
    let (before, [linear, angular]) = sums(&scene);
    advance(&mut scene, 0.1);
    assert!(scene.energy().losses.friction > 0.0, "discs have collided");
    let (after, _) = sums(&scene);
    expect("x", (after[0] - before[0]) / linear, 0.0, tolerance);
    expect("y", (after[1] - before[1]) / linear, 0.0, tolerance);
    expect("angular", (after[2] - before[2]) / angular, 0.0, tolerance);
}
