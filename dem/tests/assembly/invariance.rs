//! Invariants of random scenes.

use dem::Grains;
use dem::assembly::{Boundary, Faces, Grain, GrainState};
use proptest::prelude::*;

use crate::common::{GRAVITY, assembly, flat, gas};

const WIDTH: f64 = 0.2;

/// 24 grains fall on the floor beside walls of different friction.
fn run(start: Vec<Grain>, boundary: &Boundary) -> Vec<GrainState> {
    let p = Grains { rolling_friction: 0.1, ..Grains::default() };
    let mut scene = assembly::<f64>(&p, boundary, GRAVITY, start);
    scene.advance(800).unwrap();
    scene.states()
}

fn compare(a: &[GrainState], b: &[GrainState], map: impl Fn(&GrainState) -> GrainState) {
    for (a, b) in a.iter().zip(b) {
        let b = map(b);
        let distance = (a.x[0] - b.x[0]).hypot(a.x[1] - b.x[1]);
        assert!(distance < 1.0e-9, "{a:?} {b:?}");
        assert!((a.w - b.w).abs() < 1.0e-4 && a.contacts == b.contacts);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// The mirror image of a scene has the mirror image of its motion, to round-off.
    #[test]
    fn mirror(seed in 0..1000u64, friction in 0.0..0.8f64) {
        let p = Grains::default();
        let start = gas(&p, [0.0, 0.0], [18, 2], 0.0105, 1.0, seed);
        let mirrored = start.iter().map(|g| Grain {
            x: [WIDTH - g.x[0], g.x[1]],
            v: [-g.v[0], g.v[1]],
            w: -g.w,
            r: g.r,
        });
        let boundary = flat([WIDTH, 0.2], friction);
        let walls = Faces { left: 0.1, ..boundary.walls };
        let boundary = Boundary { walls, ..boundary };
        let walls = Faces { left: friction, right: 0.1, ..walls };
        let a = run(mirrored.collect(), &Boundary { walls, ..boundary.clone() });
        let b = run(start, &boundary);
        compare(&a, &b, |s| GrainState {
            x: [WIDTH - s.x[0], s.x[1]],
            w: -s.w,
            ..*s
        });
    }

    /// A scene on a longer floor, further along it, moves in the same way.
    #[test]
    fn translation(seed in 0..1000u64, shift in 0.0..0.5f64) {
        let p = Grains::default();
        let start = gas(&p, [0.1, 0.0], [12, 2], 0.0105, 1.0, seed);
        let moved = start.iter().map(|g| Grain { x: [g.x[0] + shift, g.x[1]], ..*g });
        let boundary = flat([1.0, 0.2], 0.5);
        let a = run(moved.collect(), &boundary);
        let b = run(start, &boundary);
        compare(&a, &b, |s| GrainState { x: [s.x[0] + shift, s.x[1]], ..*s });
    }
}
