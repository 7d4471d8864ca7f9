//! Points in motion among boxes, and how they move on.

use dempm::scene::Scene;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surrogate::cuda::Motion;
use surrogate::diagnostics::CrowdingLimit;
use surrogate::features::Obstacle;
use surrogate::rollout::Constraints;

/// A wall-bounded box with obstacles of all kinds of faces, and a plate that comes down.
pub fn scene() -> Scene {
    let text = "duration = 1.0\n[material]\nkind = \"mu-i\"\n[domain]\nsize = [4.0, 2.0]\n\
        [[column]]\nsize = [0.5, 0.5]\n\
        [[obstacle]]\ncorner = [1.0, 0.0]\nsize = [0.5, 0.8]\n\
        faces = { left = \"slip\", right = \"stick\", top = 0.5, bottom = 0.5 }\n\
        [[obstacle]]\ncorner = [2.5, 0.7]\nsize = [0.6, 0.3]\n\
        faces = { left = 0.2, right = 0.3, top = \"stick\", bottom = \"slip\" }\n\
        [plate]\ncorner = [0.2, 1.2]\nsize = [0.7, 0.4]\nvelocity = [0.1, -2.0]\nstart = 0.2\n";
    Scene::parse(text, "scene.toml").unwrap()
}

pub fn motion() -> Motion {
    Motion {
        constraints: Constraints::new(&scene()),
        fall: [0.0, -9.81e-4],
        start: 0.05,
        interval: 0.01,
        mirror: false,
        // Points may be as close together as they come.
        packing: CrowdingLimit::new(0.25, 1e-3),
    }
}

/// Frames of points outside the boxes, in motion.
pub fn start(points: usize, frames: usize, spread: f64) -> Vec<Vec<[f64; 2]>> {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let constraints = Constraints::new(&scene());
    let free = |x: [f64; 2]| {
        constraints.boxes(0.0).iter().all(|b| {
            !(x[0] > b[0] - 0.01 && x[0] < b[2] + 0.01 && x[1] > b[1] - 0.01 && x[1] < b[3] + 0.01)
        })
    };
    let mut positions = Vec::new();
    while positions.len() < points {
        let x = [rng.random_range(0.0..4.0 * spread), rng.random_range(0.0..2.0 * spread)];
        if free(x) {
            positions.push(x);
        }
    }
    let velocity: Vec<[f64; 2]> =
        positions.iter().map(|_| [0, 1].map(|_| rng.random_range(-0.01..0.01))).collect();
    let at = |k: usize| {
        let moved = positions.iter().zip(&velocity);
        moved.map(|(x, v)| [0, 1].map(|c| x[c] + k as f64 * v[c])).collect()
    };
    (0..frames).map(at).collect()
}

/// The boxes in the frame before this one.
pub fn boxes_before(motion: &Motion, frame: usize) -> Vec<Obstacle> {
    let time = motion.start + (frame - 1) as f64 * motion.interval;
    motion.constraints.obstacles(time, motion.interval)
}

pub fn single(window: &[Vec<[f64; 2]>]) -> Vec<f32> {
    window.iter().flatten().flatten().map(|&x| x as f32).collect()
}

/// The frame that follows from accelerations (m/frame²).
pub fn integrate(
    window: &[Vec<[f64; 2]>],
    motion: &Motion,
    frame: usize,
    accelerations: &[f64],
) -> Vec<[f64; 2]> {
    let (before, last) = (&window[window.len() - 2], &window[window.len() - 1]);
    let time = |frame: usize| motion.start + frame as f64 * motion.interval;
    let times = [time(frame - 1), time(frame)];
    (0..last.len())
        .map(|point| {
            let a = [0, 1].map(|k| accelerations[2 * point + k]);
            let velocity = [0, 1].map(|k| last[point][k] - before[point][k] + a[k]);
            let free = [0, 1].map(|k| last[point][k] + velocity[k]);
            motion.constraints.confine(last[point], free, times)
        })
        .collect()
}
