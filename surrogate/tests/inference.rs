//! Fast inference against the plain network.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rstest::rstest;
use surrogate::features::{Normalisation, Window, WindowInput, window_input};
use surrogate::inference::Inference;
use surrogate::network::burn_backend::{Cpu, device};
use surrogate::network::parameters::{weights, with_weights};
use surrogate::network::{Model, ModelConfig};

/// Frames of a cloud in motion.
fn trajectory(points: usize, frames: usize) -> Vec<Vec<f32>> {
    let mut rng = ChaCha8Rng::seed_from_u64(points as u64);
    let start: Vec<f32> = (0..2 * points).map(|_| rng.random_range(0.0..1.5)).collect();
    let drift: Vec<f32> = start.iter().map(|_| rng.random_range(-0.01..0.01)).collect();
    (0..frames).map(|k| start.iter().zip(&drift).map(|(x, v)| x + k as f32 * v).collect()).collect()
}

fn input(frames: &[Vec<f32>], config: &ModelConfig) -> WindowInput<Cpu> {
    let norm = Normalisation::about_zero(2, 0.01, 0.1);
    let window = Window {
        positions: &frames.concat(),
        points: frames[0].len() / 2,
        statics: &[],
        obstacles: &[],
    };
    window_input(&[window], config, &norm, &[[0.0, 2.0]; 2], &device())
}

/// Windows that move along a trajectory, so that encodings are used again; then one from elsewhere.
fn check(config: &ModelConfig, points: usize) {
    check_model(&Model::<Cpu>::new(config, 7, &device()), config, points);
}

fn check_model(model: &Model<Cpu>, config: &ModelConfig, points: usize) {
    let mut inference = Inference::new(model, config, 1);
    let long = trajectory(points, config.frames + 3);
    let other = trajectory(points + 1, config.frames);
    for frames in long.windows(config.frames).chain([&other[..], &long[..config.frames]]) {
        let input = input(frames, config);
        let found = inference.forward(&input);
        let expected: Vec<f32> = model.forward(&input).into_data().iter::<f32>().collect();
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-5, "{found} {expected}");
        }
    }
}

#[rstest]
fn networks_of_the_paper(
    #[values("baseline", "hidden1", "msg1", "msg0-hidden1", "frame4")] name: &str,
) {
    check(&ModelConfig::named(name).unwrap(), 150);
}

#[rstest]
fn other_sizes(
    #[values(2, 5, 24, 130)] width: usize,
    #[values(1, 3)] hidden_layers: usize,
    #[values(0, 1, 3)] message_layers: usize,
) {
    let config =
        ModelConfig { width, hidden_layers, message_layers, frames: 3, ..ModelConfig::default() };
    check(&config, 80);
}

/// A network grown by layers that add to the node states predicts as before, until their scales change.
#[rstest]
fn residual_layers(#[values(0, 2)] message_layers: usize) {
    let config = ModelConfig {
        width: 16,
        frames: 3,
        message_layers,
        residual_layers: 2,
        ..ModelConfig::default()
    };
    let without = ModelConfig { residual_layers: 0, ..config.clone() };
    let trained = Model::<Cpu>::new(&without, 7, &device());
    let grown = trained.clone().grown(&config, 3, &device());
    let frames = trajectory(80, 3);
    let of = |model: &Model<Cpu>, config| -> Vec<f32> {
        model.forward(&input(&frames, config)).into_data().iter::<f32>().collect()
    };
    assert_eq!(of(&grown, &config), of(&trained, &without));
    let shifted: Vec<f32> = weights(&grown).iter().map(|w| w + 0.02).collect();
    check_model(&with_weights(grown, &shifted), &config, 80);
}

/// Isolated points, and one that has more neighbours than a block of edges.
#[test]
fn few_and_many_neighbours() {
    let config = ModelConfig { width: 16, frames: 2, ..ModelConfig::default() };
    check(&config, 1);
    check(&config, 3);
    check(&config, 2000);
}

/// Networks without an implementation of their own go through the plain one.
#[rstest]
fn plain_networks(#[values("gns", "frame4-msg1-hidden1-edgemsg")] name: &str) {
    let config = ModelConfig { width: 16, gns_layers: 2, ..ModelConfig::named(name).unwrap() };
    check(&config, 60);
}
