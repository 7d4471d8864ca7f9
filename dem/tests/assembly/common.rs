//! Scenes that several tests share.

use std::sync::OnceLock;

use dem::assembly::{
    Assembly, Boundary, ColumnBox, Faces, Floor, Grain, Packed, RigidBox, on_cpu, prepare_column,
};
use dem::{Grains, Real};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub const G: f64 = 9.81;
pub const GRAVITY: [f64; 2] = [0.0, -G];

/// Default grains in steps of 0.01 sqrt(m / kn), for closed forms.
pub fn accurate() -> Grains {
    Grains { step_factor: 0.01, ..Grains::default() }
}

pub fn faces(friction: f64) -> Faces {
    Faces { left: friction, right: friction, bottom: friction, top: friction }
}

/// A flat domain whose walls have this friction.
pub fn flat(size: [f64; 2], friction: f64) -> Boundary {
    Boundary {
        corner: [0.0; 2],
        size,
        walls: faces(friction),
        floor: Floor::Flat,
        boxes: vec![],
        seed: 1,
    }
}

pub fn with_box(boundary: Boundary, obstacle: RigidBox) -> Boundary {
    Boundary { boxes: vec![obstacle], ..boundary }
}

/// A grain that does not spin.
pub fn grain(x: [f64; 2], v: [f64; 2], r: f64) -> Grain {
    Grain { x, v, w: 0.0, r }
}

pub fn loose(grains: Vec<Grain>) -> Packed {
    Packed { grains, contacts: vec![] }
}

/// An assembly of grains that are not in contact yet, in steps of [`Grains::step`].
pub fn assembly<R: Real>(
    grains: &Grains,
    boundary: &Boundary,
    gravity: [f64; 2],
    start: Vec<Grain>,
) -> Assembly<R> {
    Assembly::new(grains, boundary, gravity, grains.step(), &loose(start)).unwrap()
}

/// Advances by a time (s).
pub fn advance<R: Real>(assembly: &mut Assembly<R>, time: f64) {
    assembly.advance((time / assembly.dt()).round() as usize).unwrap();
}

/// Random grains on a lattice of `pitch` (m) from `corner`, with velocities up to `speed` (m/s).
pub fn gas(
    grains: &Grains,
    corner: [f64; 2],
    [columns, rows]: [usize; 2],
    pitch: f64,
    speed: f64,
    seed: u64,
) -> Vec<Grain> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..columns * rows)
        .map(|k| {
            let place = [k % columns, k / columns];
            let mut random = || rng.random_range(-1.0..1.0);
            Grain {
                x: [0, 1].map(|c| corner[c] + (place[c] as f64 + 0.5) * pitch),
                v: [speed * random(), speed * random()],
                w: 100.0 * random(),
                r: rng.random_range(grains.radius_min..=grains.radius_max),
            }
        })
        .collect()
}

/// A column of 0.2 m x 0.2 m at the left wall of a rough domain.
pub fn column_place() -> ColumnBox {
    ColumnBox { corner: [0.0, 0.0], size: [0.2, 0.2], loaded: true }
}

pub fn column_domain() -> Boundary {
    Boundary { floor: Floor::Rough, ..flat([0.8, 0.4], 0.0) }
}

/// The column, prepared once for all tests of the process.
pub fn column() -> &'static Packed {
    static MADE: OnceLock<Packed> = OnceLock::new();
    MADE.get_or_init(|| prepare(&Grains::default(), &column_domain(), &column_place(), 1))
}

pub fn prepare(grains: &Grains, boundary: &Boundary, place: &ColumnBox, seed: u64) -> Packed {
    prepare_column::<f32>(grains, boundary, GRAVITY, place, seed, &mut on_cpu).unwrap()
}

/// Fails unless `value` is within `tolerance` of `target`, both absolute; prints it otherwise.
#[track_caller]
pub fn expect(what: &str, value: f64, target: f64, tolerance: f64) {
    println!("{what}: {value:.6} (target {target:.6} ± {tolerance:.1e})");
    assert!(
        (value - target).abs() <= tolerance,
        "{what} is {value}, expected {target} ± {tolerance}"
    );
}
