//! Floors.

use dem::Grains;
use dem::assembly::{Boundary, Floor};
use rstest::rstest;

use crate::common::{GRAVITY, advance, assembly, flat, gas};

fn rough(size: [f64; 2], seed: u64) -> Boundary {
    Boundary { floor: Floor::Rough, seed, ..flat(size, 0.3) }
}

/// Fixed grains touch each other, reach up to y = 0, and cover the width; radii are in range.
#[rstest]
fn fixed_grains_form_a_floor(#[values(1, 2, 3)] seed: u64) {
    let p = Grains::default();
    let floor = rough([1.0, 1.0], seed).floor_grains(&p);
    for pair in floor.windows(2) {
        let [(a, ra), (b, rb)] = [pair[0], pair[1]];
        assert!(((a[0] - b[0]).hypot(a[1] - b[1]) - (ra + rb)).abs() < 1.0e-12);
    }
    assert!(floor.iter().all(|(x, r)| x[1] == -r));
    assert!(floor.iter().all(|(_, r)| (p.radius_min..=p.radius_max).contains(r)));
    let (first, last) = (floor[0], floor[floor.len() - 1]);
    assert!(first.0[0] - first.1 <= 0.0 && last.0[0] + last.1 >= 1.0);
}

/// Grains thrown onto it at 8 m/s stay above the notches between fixed grains.
#[rstest]
fn rough_floor_does_not_leak(#[values(1, 2, 3)] seed: u64) {
    let p = Grains::default();
    let mut start = gas(&p, [0.0, 0.002], [28, 6], 0.0105, 0.5, seed);
    for grain in &mut start {
        grain.v[1] -= 8.0;
    }
    let mut scene = assembly::<f32>(&p, &rough([0.3, 0.5], seed), GRAVITY, start);
    let mut lowest = f64::INFINITY;
    for _ in 0..60 {
        advance(&mut scene, 1.0e-3);
        let y = scene.states().iter().map(|s| s.x[1]).fold(f64::INFINITY, f64::min);
        lowest = lowest.min(y);
    }
    println!("lowest centre at {lowest:.5} m, overlap {:.3}", scene.max_overlap());
    assert!(lowest > -0.5 * p.radius_min, "{lowest}");
}

/// On a rough floor grains of a thin layer stop; on a flat one they roll on.
#[test]
fn rough_floor_stops_what_rolls_on_a_flat_one() {
    let p = Grains::default();
    let end = |floor: Floor| {
        let start = gas(&p, [0.1, 0.006], [10, 1], 0.0105, 0.0, 1);
        let start = start.into_iter().map(|g| dem::assembly::Grain { v: [0.5, 0.0], ..g });
        let boundary = Boundary { floor, ..flat([2.0, 0.2], 0.5) };
        let mut scene = assembly::<f32>(&p, &boundary, GRAVITY, start.collect());
        advance(&mut scene, 1.0);
        scene.energy().kinetic
    };
    assert!(end(Floor::Rough) < 0.02 * end(Floor::Flat));
}
