//! What bf16 costs on a GPU: the same rollout in two precisions.
//!
//! Without a GPU this says so and passes, unless `DEMPM_REQUIRE_GPU=1`.

use std::path::Path;

use dempm::scene::Scene;
use surrogate::evaluation::mean_square_distance;
use surrogate::network::Precision;
use surrogate::rollout::{InitialFrames, Rollout};
use surrogate::simulator::Simulator;

/// MSE of the model that comes with the program on the last frame of this scene, box units
/// (models/README.md).
const ERROR_OF_THE_MODEL: f64 = 7.8e-4;

#[test]
fn rounding_is_far_below_the_error_of_a_model() {
    let Some(device) = gpu::for_tests() else { return };
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let scene = Scene::load(root.join("scenes/discs.toml")).unwrap();
    let simulator = |precision| {
        let model = Simulator::load(&root.join("models/tgnns-tiny.safetensors")).unwrap();
        // Each rollout has a thread and needs a stream.
        Simulator { gpu: Some(device.with_own_stream().unwrap()), precision, ..model }
    };
    let [single, half] = [Precision::F32, Precision::Bf16].map(simulator);
    let width = scene.domain.size[0];
    let start = InitialFrames::from_scene(scene, &single).unwrap();
    let [mut exact, mut rounded] = [&single, &half].map(|s| Rollout::new(s, &start));
    let mut errors = Vec::new();
    for _ in start.positions.len()..start.frames {
        let (a, b) = (exact.advance().unwrap(), rounded.advance().unwrap());
        errors.push(mean_square_distance(b, a) / (width * width));
    }
    for (frame, error) in errors.iter().enumerate().step_by(20) {
        println!("frame {:>3} after the start: {error:.1e}", frame + 1);
    }
    let largest = errors.iter().copied().fold(0.0, f64::max);
    assert!(largest < 0.01 * ERROR_OF_THE_MODEL, "{largest:e}");
    assert!(largest > 0.0, "the same precision twice");
}
