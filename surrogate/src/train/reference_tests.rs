//! The kernels against plain Burn on the same GPU, at the size of the paper's scenes: every network of the paper,
//! and one that sees surfaces and material.
//!
//! Burn multiplies float32 with 11 bits of it on tensor cores (TF32) where the kernels have 22. An output, some
//! ten linear layers deep, is then off by a thousandth or so, and one argument of LeakyReLU in a thousand changes
//! its sign, which moves the gradient by some per cent. What is wrong in a kernel moves them by their own size.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::all_reduce::SingleProcess;
use super::backend::Backend;
use super::burn::BurnBackend;
use super::config::TrainConfig;
use super::cuda::{CudaBackend, CudaBatch};
use super::input::InputSpec;
use crate::cuda::HostWindows;
use crate::data::Batch;
use crate::features::{Normalisation, Obstacle};
use crate::network::burn_backend::gpu_device;
use crate::network::{ModelConfig, NodeFeature, PAPER_NETWORKS};

/// Columns and rows of the points, as in the paper's column of 3 m x 3 m.
const SIDE: usize = 48;
/// Optimiser steps.
const STEPS: usize = 10;

/// Largest relative errors of outputs, of the first gradient and of the losses.
const OUTPUT: f64 = 1e-2;
const GRADIENT: f64 = 0.2;
const LOSS: f64 = 2e-2;

fn spec(config: ModelConfig) -> InputSpec {
    let further = config.further_node_features();
    let normalisation = Normalisation {
        features_mean: vec![0.1; further],
        features_std: vec![0.5; further],
        ..Normalisation::about_zero(2, 0.01, 1.0)
    };
    InputSpec { config, normalisation, bounds: [[0.0, 10.0]; 2] }
}

/// A window of a lattice that is stirred, and random targets.
fn batch(config: &ModelConfig) -> Batch {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut jitter = |size: f32| rng.random_range(-size..size);
    let points = SIDE * SIDE;
    let place = |k: usize| (k as f32 + 0.5) / 16.0;
    let start: Vec<f32> = (0..points)
        .flat_map(|p| [place(p % SIDE), place(p / SIDE)])
        .map(|x| x + jitter(0.02))
        .collect();
    let drift: Vec<f32> = start.iter().map(|_| jitter(0.01)).collect();
    let at = |k: usize| start.iter().zip(&drift).map(move |(x, v)| x + k as f32 * v);
    let fixed = Obstacle { friction: [0.5; 4], ..Obstacle::fixed([[3.0, 0.0], [4.0, 1.0]]) };
    let plate = Obstacle {
        corners: [[1.0, 3.2], [2.0, 4.0]],
        velocity: [0.0, -0.01],
        elapsed: 12.0,
        friction: [0.3; 4],
    };
    Batch {
        windows: vec![(0..config.window()).flat_map(at).collect()],
        points: vec![points],
        statics: vec![match config.node_features.contains(&NodeFeature::Material) {
            true => [0.5, -3.0, 0.5, 1.0].repeat(points),
            false => Vec::new(),
        }],
        obstacles: vec![vec![fixed, plate]],
        targets: (0..2 * points).map(|_| jitter(1.0)).collect(),
    }
}

fn distance(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt()
}

/// Of `b` relative to `a`.
fn relative(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len());
    distance(a, b) / distance(a, &vec![0.0; a.len()])
}

/// One test at a time, and its networks on one thread. Burn gives each thread a stream with memory of its own; with
/// many at once it panicked on an H100, "Memory page 0 doesn't exist".
fn alone() -> MutexGuard<'static, ()> {
    static TEST: Mutex<()> = Mutex::new(());
    TEST.lock().unwrap_or_else(PoisonError::into_inner)
}

#[test]
fn kernels_are_burn_at_full_size() {
    let Some(device) = gpu::for_tests() else { return };
    let _alone = alone();
    for name in PAPER_NETWORKS {
        kernels_are_burn(name, ModelConfig::named(name).unwrap(), &device);
    }
    let node_features =
        vec![NodeFeature::Acceleration, NodeFeature::Surfaces, NodeFeature::Material];
    kernels_are_burn("surfaces", ModelConfig { node_features, ..ModelConfig::default() }, &device);
}

#[expect(clippy::print_stdout, reason = "what --nocapture shows")]
fn kernels_are_burn(name: &str, network: ModelConfig, device: &Arc<gpu::Device>) {
    let spec = spec(network);
    let batch = batch(&spec.config);
    let config = TrainConfig { seed: 3, ..TrainConfig::default() };
    let points = SIDE * SIDE;
    let burn = BurnBackend::new(gpu_device(device), &spec.config, &config);
    let kernels = CudaBackend::new(device, &spec.config, &config, points, None).unwrap();
    let run = |mut backend: Backend| {
        let input = || match &backend {
            Backend::BurnCuda(burn) => {
                super::backend::BackendBatch::BurnCuda(spec.build(&batch, burn.device()))
            }
            _ => super::backend::BackendBatch::Cuda(CudaBatch {
                windows: HostWindows::new(batch.clone(), None),
                spec: spec.clone().into(),
            }),
        };
        let batches: Vec<_> = (0..=STEPS).map(|_| input()).collect();
        let output = backend.predict(&batches[0]).unwrap();
        let (mut gradient, mut seconds) = (Vec::new(), 0.0);
        for (step, batch) in batches.into_iter().skip(1).enumerate() {
            let began = Instant::now();
            backend.step(batch, 1e-3, &mut SingleProcess).unwrap();
            if step == 0 {
                // Adam's first average of the gradient is a tenth of it.
                gradient = backend.state().unwrap().moments.parts().1.to_vec();
            } else {
                seconds += began.elapsed().as_secs_f64();
            }
        }
        let losses: Vec<f32> =
            backend.take_losses().unwrap().into_iter().map(|loss| loss as f32).collect();
        (output, gradient, losses, 1e3 * seconds / (STEPS - 1) as f64)
    };
    let (output, gradient, losses, burn_ms) = run(Backend::BurnCuda(burn));
    let (found_output, found_gradient, found_losses, ms) = run(Backend::Cuda(kernels));
    let errors = [
        relative(&output, &found_output),
        relative(&gradient, &found_gradient),
        relative(&losses, &found_losses),
    ];
    println!(
        "{name}: output {:.1e}, gradient {:.1e}, losses of {STEPS} steps {:.1e}; {burn_ms:.1} ms a \
         step with Burn, {ms:.2} ms queued with the kernels",
        errors[0], errors[1], errors[2]
    );
    assert!(errors[0] < OUTPUT && errors[1] < GRADIENT && errors[2] < LOSS, "{name}: {errors:?}");
    assert!(losses[STEPS - 1] < losses[0], "{name} learnt nothing");
    // Parts by themselves: a wrong small one must not hide behind large ones.
    const PART: usize = 997;
    let typical = distance(&gradient, &vec![0.0; gradient.len()])
        * (PART as f64 / gradient.len() as f64).sqrt();
    for (k, (a, b)) in gradient.chunks(PART).zip(found_gradient.chunks(PART)).enumerate() {
        let size = distance(a, &vec![0.0; a.len()]).max(typical);
        assert!(distance(a, b) < 2.0 * GRADIENT * size, "{name}: weights from {}", PART * k);
    }
}

/// What the kernels do not support trains and predicts on the GPU all the same.
#[test]
fn burn_computes_what_kernels_do_not() {
    let Some(device) = gpu::for_tests() else { return };
    let _alone = alone();
    let wide = ModelConfig { width: 160, frames: 3, ..ModelConfig::default() };
    let long = ModelConfig { frames: 18, gns_layers: 2, ..ModelConfig::named("gns").unwrap() };
    for config in [wide, long] {
        let spec = spec(config);
        let batch = batch(&spec.config);
        let config = TrainConfig { seed: 3, ..TrainConfig::default() };
        let mut backend =
            Backend::new(Some(&device), None, &spec.config, &config, SIDE * SIDE).unwrap();
        let Backend::BurnCuda(burn) = &backend else { panic!("not with Burn") };
        let there = burn.device().clone();
        for _ in 0..STEPS {
            let batch = super::backend::BackendBatch::BurnCuda(spec.build(&batch, &there));
            backend.step(batch, 1e-3, &mut SingleProcess).unwrap();
        }
        let losses = backend.take_losses().unwrap();
        assert!(losses[STEPS - 1] < losses[0], "{:?}: {losses:?}", spec.config.kind);
    }
}
