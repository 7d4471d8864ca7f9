//! Ranks hold equal weights and learn what one process with all windows would, or from the mean of
//! their losses.

use std::net::TcpListener;
use std::ops::Range;
use std::sync::Arc;
use std::thread;

use gpu::Device;
use gpu::ranks::{Environment, Ranks, RanksError};

use super::all_reduce::{AllReduce, SingleProcess};
use super::burn::BurnBackend;
use super::config::{LossOver, TrainConfig};
use super::cuda::{CudaBackend, CudaBatch};
use super::input::InputSpec;
use super::state::State;
use super::tcp::Tcp;
use crate::cuda::HostWindows;
use crate::data::Batch;
use crate::features::Normalisation;
use crate::network::ModelConfig;
use crate::network::burn_backend::{CpuAutodiff, device};

const STEPS: u64 = 20;

fn spec() -> InputSpec {
    let config = ModelConfig { width: 8, frames: 3, connection_radius: 0.3, ..Default::default() };
    let normalisation = Normalisation::about_zero(2, 0.01, 1.0);
    InputSpec { config, normalisation, bounds: [[0.0, 1.0]; 2] }
}

fn config() -> TrainConfig {
    TrainConfig { seed: 3, ema: 0.9, steps: STEPS, ..TrainConfig::default() }
}

/// Each rank relative to its own targets.
fn own_losses() -> TrainConfig {
    TrainConfig { loss_over: LossOver::Process, steps: 1, ..config() }
}

/// Windows of different sizes, so that they weigh differently in the loss.
fn batch(step: u64, windows: Range<u64>) -> Batch {
    let mut batch = Batch::default();
    for window in windows {
        let number = (4 * step + window) as f32;
        let points = 6 + 3 * window as usize;
        let at = |i: usize| 0.5 + 0.4 * ((i as f32) * 1.7 + number).sin();
        batch
            .windows
            .push((0..3 * 2 * points).map(|i| at(i % (2 * points)) + 1e-3 * (i as f32)).collect());
        batch.targets.extend((0..2 * points).map(|i| (i as f32 + number).cos() * (1.0 + number)));
        batch.points.push(points);
        batch.statics.push(Vec::new());
        batch.obstacles.push(Vec::new());
    }
    batch
}

/// Trains on some of the four windows of each step.
fn train(
    config: &TrainConfig,
    windows: Range<u64>,
    ranks: &mut dyn AllReduce,
) -> (State, Vec<f64>) {
    let spec = spec();
    let mut backend = BurnBackend::<CpuAutodiff>::new(device(), &spec.config, config);
    for step in 0..config.steps {
        let graph = spec.build(&batch(step, windows.clone()), &device());
        backend.step(graph, 1e-3, ranks).unwrap();
    }
    (backend.state().clone(), backend.take_losses())
}

/// The same on a GPU, alone or with others.
fn train_on(
    device: &Arc<Device>,
    config: &TrainConfig,
    windows: Range<u64>,
    ranks: Option<Arc<Ranks>>,
) -> (State, Vec<f64>) {
    let spec = Arc::new(spec());
    let mut backend = CudaBackend::new(device, &spec.config, config, 42, ranks).unwrap();
    for step in 0..config.steps {
        let windows = HostWindows::new(batch(step, windows.clone()), None);
        let batch = CudaBatch { windows, spec: spec.clone() };
        backend.step(&batch, 1e-3).unwrap();
    }
    (backend.state().unwrap(), backend.take_losses().unwrap())
}

/// A port that was free a moment ago.
pub fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// Ranks that meet there.
fn environments(size: usize) -> Vec<Environment> {
    let port = free_port();
    let address = ("127.0.0.1".to_owned(), port);
    (0..size)
        .map(|rank| Environment { rank, size, local_rank: rank, address: address.clone() })
        .collect()
}

/// Runs two ranks, each with two of the four windows.
fn two_ranks<T: Send>(train: impl Fn(Environment, Range<u64>) -> T + Sync) -> [T; 2] {
    let train = &train;
    let [first, second] = environments(2).try_into().unwrap();
    thread::scope(|scope| {
        let ranks = [(first, 0..2), (second, 2..4)];
        let ranks = ranks.map(|(environment, windows)| scope.spawn(|| train(environment, windows)));
        ranks.map(|rank| rank.join().unwrap())
    })
}

/// Two ranks hold the same weights, equal to those of one process with all windows up to rounding:
/// sums have another order, and Adam's first steps divide small gradients by their own size.
fn compare([first, second]: [(State, Vec<f64>); 2], (one, losses): (State, Vec<f64>)) {
    assert_eq!(first, second);
    let start =
        BurnBackend::<CpuAutodiff>::new(device(), &spec().config, &config()).state().clone();
    let distance = |a: &[f32], b: &[f32]| {
        a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt()
    };
    let moved = distance(&start.weights, &one.weights);
    assert!(moved > 0.1, "nothing was learnt: {moved}");
    let apart = distance(&first.0.weights, &one.weights) / moved;
    assert!(apart < 1e-3, "{apart:e}");
    assert_eq!(losses.len() as u64, STEPS);
    for (a, b) in losses.iter().zip(&first.1) {
        assert!((a / b - 1.0).abs() < 1e-4, "{a} {b}");
    }
}

/// What both ranks learn from in their first step is the mean of the two losses that each has alone,
/// and the gradient that of the two gradients, a tenth of which Adam's average is then.
fn compare_means([first, second]: [(State, Vec<f64>); 2], alone: [(State, Vec<f64>); 2]) {
    assert_eq!(first, second);
    let [a, b] = &alone;
    let mean = (a.1[0] + b.1[0]) / 2.0;
    assert!((first.1[0] / mean - 1.0).abs() < 1e-5, "{} {mean}", first.1[0]);
    let apart = (a.1[0] / b.1[0] - 1.0).abs();
    assert!(apart > 0.01, "the two losses are too much alike to tell: {apart}");
    let gradient = |(state, _): &(State, Vec<f64>)| state.moments.parts().1.to_vec();
    let (both, parts) = (gradient(&first), [a, b].map(gradient));
    let size = both.iter().fold(0.0, |most: f32, g| most.max(g.abs()));
    for (k, g) in both.iter().enumerate() {
        let mean = (parts[0][k] + parts[1][k]) / 2.0;
        assert!((g - mean).abs() < 1e-4 * size, "{k}: {g} {mean}");
    }
}

#[test]
fn ranks_hold_equal_weights_and_learn_like_one() {
    let [first, second] = two_ranks(|environment, windows| {
        let mut ranks = Tcp::join(environment, &[0; 32], |_| ()).unwrap();
        [config(), own_losses()].map(|config| train(&config, windows.clone(), &mut ranks))
    });
    let [[first, first_mean], [second, second_mean]] = [first, second];
    compare([first, second], train(&config(), 0..4, &mut SingleProcess));
    let alone = [0..2, 2..4].map(|windows| train(&own_losses(), windows, &mut SingleProcess));
    compare_means([first_mean, second_mean], alone);
}

/// One process has the same loss either way, up to rounding.
#[test]
fn a_loss_of_its_own_changes_nothing_for_one() {
    let own = TrainConfig { loss_over: LossOver::Process, ..config() };
    let (once, whole) =
        (train(&own, 0..4, &mut SingleProcess), train(&config(), 0..4, &mut SingleProcess));
    compare([once.clone(), once], whole);
    let Some(device) = gpu::for_tests() else { return };
    // Compared with itself: Adam amplifies the rounding between a GPU and a CPU.
    let [once, whole] = [&own, &config()].map(|config| train_on(&device, config, 0..4, None));
    compare([once.clone(), once], whole);
}

/// Each window relative to its own targets: the mean of what the windows have alone, on a CPU and on
/// a GPU, also where two ranks share the windows.
#[test]
fn windows_weigh_the_same_in_a_mean() {
    // The floor tells the windows apart, whose losses would all be about 1.
    let once = || TrainConfig { steps: 1, loss_floor: 2.0, ..config() };
    let config = TrainConfig { loss_over: LossOver::Window, ..once() };
    let single = |window| train(&config, window..window + 1, &mut SingleProcess).1[0];
    let mean = (0..4).map(single).sum::<f64>() / 4.0;
    let whole = train(&config, 0..4, &mut SingleProcess);
    assert!((whole.1[0] / mean - 1.0).abs() < 1e-6, "{} {mean}", whole.1[0]);
    let by_step = train(&once(), 0..4, &mut SingleProcess);
    assert!((by_step.1[0] / mean - 1.0).abs() > 0.01, "the windows are too much alike to tell");
    let ranks = two_ranks(|environment, windows| {
        let mut ranks = Tcp::join(environment, &[0; 32], |_| ()).unwrap();
        train(&config, windows, &mut ranks)
    });
    for (_, losses) in &ranks {
        assert!((losses[0] / mean - 1.0).abs() < 1e-6, "{} {mean}", losses[0]);
    }
    let Some(device) = gpu::for_tests() else { return };
    let (state, losses) = train_on(&device, &config, 0..4, None);
    // Rounding of float32 in the forward and backward pass.
    assert!((losses[0] / mean - 1.0).abs() < 1e-4, "{} {mean}", losses[0]);
    let [found, expected] = [&state, &whole.0].map(|state| state.moments.parts().1.to_vec());
    let size = expected.iter().fold(0.0, |most: f32, g| most.max(g.abs()));
    for (k, (a, b)) in found.iter().zip(&expected).enumerate() {
        assert!((a - b).abs() < 1e-3 * size, "{k}: {a} {b}");
    }
}

/// NCCL changes nothing for a single rank, which needs no second GPU.
#[test]
fn one_rank_on_a_gpu_is_alone() {
    let Some(device) = gpu::for_tests() else { return };
    let ranks = match Ranks::join(&environments(1)[0], &device, &[0; 32], |_| ()) {
        Err(RanksError::NcclMissing) => {
            eprintln!("skipped: {}", RanksError::NcclMissing);
            return;
        }
        ranks => Arc::new(ranks.unwrap()),
    };
    let train = |ranks| train_on(&device, &config(), 0..4, ranks);
    assert_eq!(train(Some(ranks)), train(None));
}

#[test]
fn gpus_hold_equal_weights_and_learn_like_one() {
    let Some(device) = gpu::for_tests() else { return };
    if Device::count() < 2 {
        eprintln!("skipped: one GPU, two are needed");
        return;
    }
    let two = |config: &TrainConfig| {
        two_ranks(|environment, windows| {
            let device = Device::new(environment.rank).unwrap();
            let ranks = Arc::new(Ranks::join(&environment, &device, &[0; 32], |_| ()).unwrap());
            let learnt = train_on(&device, config, windows, Some(ranks.clone()));
            ranks.all_done();
            learnt
        })
    };
    compare(two(&config()), train_on(&device, &config(), 0..4, None));
    let alone = [0..2, 2..4].map(|windows| train_on(&device, &own_losses(), windows, None));
    compare_means(two(&own_losses()), alone);
}
