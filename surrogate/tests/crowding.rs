//! Rollouts of a network that holds nothing up: all points fall into each other on the floor.
//!
//! Without a GPU the second half says so and passes, unless `DEMPM_REQUIRE_GPU=1`.

use dempm::scene::Scene;
use rstest::rstest;
use surrogate::diagnostics::CrowdingLimit;
use surrogate::features::Normalisation;
use surrogate::network::burn_backend::device;
use surrogate::network::{Model, ModelConfig};
use surrogate::rollout::{InitialFrames, Rollout, RolloutError};
use surrogate::simulator::{Simulator, Training};

/// No distance of a lattice of `SPACING`, so that rounding decides about no edge (m).
const RADIUS: f64 = 0.24;
const SPACING: f64 = 0.0625;

/// Predicts free fall but for a nanometre.
fn simulator(mirror: bool) -> Simulator {
    let config = ModelConfig {
        width: 32,
        hidden_layers: 1,
        message_layers: 1,
        frames: 3,
        connection_radius: RADIUS,
        ..ModelConfig::default()
    };
    let (model, training) = (Model::new(&config, 1, &device()), Training::untrained(0.01, true));
    let normalisation = Normalisation::about_zero(2, 0.01, 1e-9);
    Simulator { mirror, ..Simulator::new(model, config, normalisation, training) }
}

/// What is predicted until the rollout ends by itself.
fn fall(simulator: &Simulator, start: &InitialFrames) -> (Vec<Vec<[f64; 2]>>, RolloutError) {
    let mut rollout = Rollout::new(simulator, start);
    let mut frames = Vec::new();
    while frames.len() < 100 {
        match rollout.advance() {
            Ok(frame) => frames.push(frame.to_vec()),
            Err(error) => return (frames, error),
        }
    }
    panic!("no end in 100 frames");
}

#[rstest]
fn a_rollout_ends_when_points_are_pressed_together(#[values(false, true)] mirror: bool) {
    let text = "duration = 1.0\n[material]\nkind = \"mu-i\"\n[domain]\nsize = [2.0, 2.0]\n\
        cell = 0.125\n[[column]]\ncorner = [0.5, 0.0]\nsize = [1.0, 1.75]\n";
    let mut simulator = simulator(mirror);
    let start =
        InitialFrames::from_scene(Scene::parse(text, "scene.toml").unwrap(), &simulator).unwrap();
    let (frames, error) = fall(&simulator, &start);
    let RolloutError::Crowded { frame, neighbours, plane } = error else { panic!("{error}") };
    assert_eq!(frame, start.positions.len() + frames.len());
    assert!(neighbours > 3.0 * plane, "{neighbours} of {plane}");
    // Not before most of the 1.75 m have fallen, which takes 60 frames.
    assert!((40..65).contains(&frame), "frame {frame}");
    let packing = CrowdingLimit::new(RADIUS, SPACING);
    assert!(frames.iter().all(|frame| packing.check(0, frame).is_ok()));

    let Some(gpu) = gpu::for_tests() else { return };
    simulator.gpu = Some(gpu);
    let (found, failure) = fall(&simulator, &start);
    assert_eq!(failure, error);
    for (found, expected) in found.iter().zip(&frames) {
        for (a, b) in found.as_flattened().iter().zip(expected.as_flattened()) {
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
    }
}
