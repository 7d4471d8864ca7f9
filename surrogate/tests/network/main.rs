//! The networks, their inputs and their files.

mod features;
mod files;
mod gradients;
mod graphs;
mod initialisation;
mod messages;
mod mirror;
mod numpy;
mod sizes;

use std::collections::BTreeMap;
use std::path::Path;

use burn::backend::{Autodiff, Flex};
use burn::module::{ModuleVisitor, Param};
use burn::tensor::backend::{AutodiffBackend, Backend};
use burn::tensor::{Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surrogate::features::{Normalisation, Window, WindowInput, window_input};
use surrogate::network::{Model, ModelConfig, weights};

type Cpu = Flex;
type Train = Autodiff<Flex>;

/// Positions of a random cloud that shears and shrinks, so that some edges come and others go.
/// Multiples of 2^-14 in the unit box, so that shifts by whole numbers are exact.
fn cloud(points: usize, frames: usize, seed: u64) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let start: Vec<f32> = (0..2 * points).map(|_| rng.random_range(0.02..0.98)).collect();
    let drift: Vec<f32> = start.iter().map(|_| rng.random_range(-0.01..0.01)).collect();
    let mut positions = Vec::new();
    for frame in 0..frames {
        positions.extend(start.iter().zip(&drift).map(|(x, v)| {
            let x = x + frame as f32 * (v + 0.01 * (0.5 - x));
            (x * 16384.0).round() / 16384.0
        }));
    }
    positions
}

const UNIT_BOX: [[f64; 2]; 2] = [[0.0, 1.0]; 2];

fn normalisation() -> Normalisation {
    Normalisation {
        velocity_mean: vec![0.0, 0.001],
        velocity_std: vec![0.01; 2],
        acceleration_mean: vec![1.0 / 3.0; 2],
        acceleration_std: vec![0.1; 2],
        ..Normalisation::default()
    }
}

/// A small relative of a named network.
fn small(name: &str) -> ModelConfig {
    let config = ModelConfig::named(name).unwrap();
    ModelConfig { width: 8, gns_layers: 2, frames: 3, ..config }
}

fn input<B: Backend>(config: &ModelConfig, windows: &[(&[f32], usize)]) -> WindowInput<B> {
    let windows: Vec<Window> = windows
        .iter()
        .map(|&(positions, points)| Window { positions, points, statics: &[], obstacles: &[] })
        .collect();
    window_input(&windows, config, &normalisation(), &UNIT_BOX, &Default::default())
}

fn model<B: Backend>(config: &ModelConfig) -> Model<B> {
    Model::new(config, 7, &Default::default())
}

fn values<B: Backend, const D: usize>(tensor: Tensor<B, D>) -> Vec<f64> {
    tensor.into_data().iter::<f64>().collect()
}

fn close(a: &[f64], b: &[f64], tolerance: f64) {
    assert_eq!(a.len(), b.len());
    let error = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(error <= tolerance, "differs by {error}");
}

/// A scalar that depends on every output: sum of c_i a_i with c_i = 1, 2, 3, ...
fn weighted_sum<B: Backend>(output: Tensor<B, 2>) -> Tensor<B, 1> {
    let [points, dimensions] = output.dims();
    let weights: Vec<f32> = (1..=points * dimensions).map(|i| i as f32 / 10.0).collect();
    let data = TensorData::new(weights, [points, dimensions]);
    let weights = Tensor::from_data(data, (&output.device(), output.dtype()));
    (output * weights).sum()
}

/// Smallest share of non-zero entries among the gradients of all parameters.
struct NonZero<'a> {
    gradients: &'a <Train as AutodiffBackend>::Gradients,
    tensors: usize,
    share: f64,
}

impl ModuleVisitor<Train> for NonZero<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<Train, D>>) {
        let gradient = values(param.val().grad(self.gradients).expect("a gradient"));
        assert!(gradient.iter().all(|g| g.is_finite()));
        let non_zero = gradient.iter().filter(|&&g| g != 0.0).count();
        self.tensors += 1;
        self.share = self.share.min(non_zero as f64 / gradient.len() as f64);
    }
}

fn saved(path: &Path, config: &ModelConfig) -> Model<Cpu> {
    let model = model::<Cpu>(config);
    let extra = BTreeMap::from([("step".to_string(), "12".to_string())]);
    let norm = normalisation();
    weights::save(path, &model, config, &norm, extra).unwrap();
    model
}
