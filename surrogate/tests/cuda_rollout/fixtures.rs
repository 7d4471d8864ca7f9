//! Networks that read all that there is, and what they read.

use burn::backend::Flex;
use burn::tensor::Tensor;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surrogate::features::{Normalisation, Obstacle};
use surrogate::network::{DIMENSIONS, ModelConfig, NodeFeature};

pub const RADIUS: f32 = 0.25;

pub fn normalisation() -> Normalisation {
    Normalisation {
        velocity_mean: (0..DIMENSIONS).map(|k| 0.001 * k as f64).collect(),
        velocity_std: vec![0.01; DIMENSIONS],
        acceleration_mean: vec![1e-4; DIMENSIONS],
        acceleration_std: vec![2e-3; DIMENSIONS],
        features_mean: [
            vec![10.0],
            vec![1e-4; DIMENSIONS],
            vec![0.1; 10],
            vec![0.5, 0.3, 0.4],
            vec![0.2; 4],
        ]
        .concat(),
        features_std: [
            vec![7.0],
            vec![1e-3; DIMENSIONS],
            vec![0.9; 10],
            vec![0.3, 0.2, 0.1],
            vec![0.3; 4],
        ]
        .concat(),
    }
}

/// Further features, of which the last three do not change.
pub const FEATURES: [NodeFeature; 6] = [
    NodeFeature::Overburden,
    NodeFeature::Acceleration,
    NodeFeature::Surfaces,
    NodeFeature::InitialStress,
    NodeFeature::InitialSolidFraction,
    NodeFeature::Material,
];
/// Columns of those that do not change.
pub const STATICS: usize = 7;

/// The normalisation of a network, with or without further features.
pub fn normalisation_for(config: &ModelConfig) -> Normalisation {
    let mut norm = normalisation();
    if config.node_features == [NodeFeature::Surfaces] {
        norm.features_mean.drain(..1 + DIMENSIONS);
        norm.features_std.drain(..1 + DIMENSIONS);
    }
    norm.features_mean.truncate(config.further_node_features());
    norm.features_std.truncate(config.further_node_features());
    norm
}

/// Networks that read all that there is: plain, with further features, with obstacles, and the GNS with them.
pub fn readers() -> [ModelConfig; 4] {
    let plain = ModelConfig { frames: 3, ..ModelConfig::default() };
    let gns = ModelConfig::named("gns").unwrap();
    [
        plain.clone(),
        ModelConfig { node_features: FEATURES.to_vec(), clamped_walls: true, ..plain.clone() },
        ModelConfig { node_features: FEATURES.to_vec(), obstacles: true, ..plain },
        ModelConfig { frames: 3, node_features: FEATURES.to_vec(), obstacles: true, ..gns },
    ]
}

/// Features that do not change, if the network reads them.
pub fn statics(config: &ModelConfig, points: usize) -> Vec<f32> {
    if config.node_features.is_empty() { Vec::new() } else { random(points, STATICS, 1.0, 11) }
}

/// Two obstacles beside each other in the middle of the unit box, and a plate that has begun to come
/// down.
pub fn obstacles(config: &ModelConfig) -> Vec<Obstacle> {
    let friction = [0.1, 0.2, 0.3, 0.4];
    let [left, right] = [[[0.3, 0.0], [0.6, 0.5]], [[0.6, 0.4], [0.8, 0.7]]]
        .map(|corners| Obstacle { friction, ..Obstacle::fixed(corners) });
    let plate = Obstacle {
        velocity: [0.001, -0.013],
        elapsed: 1.7,
        friction,
        ..Obstacle::fixed([[0.2, 0.9], [0.7, 1.1]])
    };
    if config.sees_boxes() { vec![left, plate, right] } else { Vec::new() }
}

pub fn random(points: usize, columns: usize, extent: f32, seed: u64) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..points * columns).map(|_| rng.random_range(0.0..extent)).collect()
}

pub fn rows(tensor: &Tensor<Flex, 2>) -> Vec<f32> {
    tensor.to_data().iter::<f32>().collect()
}
