//! Times of a frame of a rollout on the GPU: its parts besides the network, all of these, and the
//! whole frame in two precisions, with the Baseline network or with that of a weights file.
//!
//! `cargo run --release -p surrogate --example gpu_frames -- [WEIGHTS]`

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use cudarc::driver::CudaSlice;
use cudarc::driver::sys::{CUgraphInstantiate_flags, CUstreamCaptureMode};
use dempm::scene::Scene;
use gpu::Device;
use surrogate::cuda::{
    BLOCK, BatchBuilder, Capacity, CudaError, CudaNetwork, CudaRollout, FrameBuilder, FrameInput,
    HostWindows, Integrator, Motion, Network, NewFrame, Start,
};
use surrogate::data::Batch;
use surrogate::diagnostics::CrowdingLimit;
use surrogate::features::Normalisation;
use surrogate::network::Model;
use surrogate::network::burn_backend::{Cpu, device as cpu};
use surrogate::network::parameters::weights;
use surrogate::network::weights::load;
use surrogate::network::{ModelConfig, Precision};
use surrogate::rollout::Constraints;

type Failure = Box<dyn std::error::Error>;

/// Launches of a part in one CUDA graph, and launches of the graph.
const REPEATS: usize = 20;
const LAUNCHES: usize = 20;
/// Blocks of a rollout, or batches, that are timed.
const BLOCKS: usize = 20;

/// A network to time.
struct Timed {
    config: ModelConfig,
    norm: Normalisation,
    weights: Vec<f32>,
}

impl Timed {
    /// The Baseline with random weights.
    fn baseline() -> Self {
        let config = ModelConfig::default();
        let weights = weights(&Model::<Cpu>::new(&config, 1, &cpu()));
        Self { norm: Normalisation::about_zero(2, 0.01, 1e-3), config, weights }
    }

    /// That of a weights file.
    fn load(path: &Path) -> Result<Self, Failure> {
        let (model, config, norm, _) = load::<Cpu>(path, &cpu())?;
        Ok(Self { config, norm, weights: weights(&model) })
    }

    /// Features of `points` points that never change, all zero.
    fn statics(&self, points: usize) -> Vec<f32> {
        let features = self.config.node_features.iter().filter(|feature| feature.is_static());
        let columns: usize = features.map(|feature| feature.columns(self.config.dimensions)).sum();
        vec![0.0; columns * points]
    }
}

/// Nothing accelerates.
struct Rest(CudaSlice<f32>);

impl Network for Rest {
    fn reserve(&mut self, _: usize, _: usize) -> Result<(), CudaError> {
        Ok(())
    }

    fn accelerations(
        &mut self,
        _: &FrameInput,
        _: &FrameInput,
    ) -> Result<&CudaSlice<f32>, CudaError> {
        Ok(&self.0)
    }
}

/// Microseconds of one call of `work`, launched as a part of a CUDA graph.
fn time(device: &Device, mut work: impl FnMut() -> Result<(), gpu::Error>) -> Result<f64, Failure> {
    work()?;
    let stream = device.stream();
    stream.synchronize()?;
    stream.begin_capture(CUstreamCaptureMode::CU_STREAM_CAPTURE_MODE_THREAD_LOCAL)?;
    let queued = (0..REPEATS).try_for_each(|_| work());
    let graph = stream.end_capture(CUgraphInstantiate_flags(0))?.ok_or("nothing captured")?;
    queued?;
    graph.launch()?;
    stream.synchronize()?;
    let began = Instant::now();
    (0..LAUNCHES).try_for_each(|_| graph.launch())?;
    stream.synchronize()?;
    Ok(began.elapsed().as_secs_f64() * 1e6 / (REPEATS * LAUNCHES) as f64)
}

/// Distance of points but for the offsets (m).
const SPACING: f64 = 1.0 / 16.0;

/// A column of points 1/16 m apart, as high as wide, each a little off its place.
fn column(points: usize) -> Vec<[f64; 2]> {
    let columns = (points as f64).sqrt().ceil() as usize;
    let offset = |k: usize| (k as f64 * 0.618_034).fract() * 0.02;
    let place = |k: usize, n: usize| (n as f64 + 0.5) * SPACING + offset(k);
    (0..points).map(|k| [place(k, k % columns), place(3 * k, k / columns)]).collect()
}

fn main() -> Result<(), Failure> {
    let device = Device::new(0)?;
    let network = match std::env::args_os().nth(1) {
        Some(path) => Timed::load(Path::new(&path))?,
        None => Timed::baseline(),
    };
    println!("{}; microseconds, memory in MiB", device.name());
    println!(
        "{:>7} {:>9} {:>8} {:>9} {:>9} {:>10} {:>9} {:>9} {:>9} {:>9} {:>9}",
        "points",
        "edges",
        "graph",
        "features",
        "integrate",
        "no network",
        "f32",
        "bf16",
        "memory",
        "memory",
        "batch 2"
    );
    for points in [1000, 2304, 5000, 10_000, 25_000, 50_000, 100_000] {
        measure(&device, &network, points)?;
    }
    Ok(())
}

fn measure(device: &Arc<Device>, timed: &Timed, points: usize) -> Result<(), Failure> {
    let Timed { config, norm, .. } = timed;
    let statics = timed.statics(points);
    let text = "duration = 1.0\n[material]\nkind = \"mu-i\"\n[domain]\nsize = [100.0, 100.0]\n\
        [[column]]\nsize = [0.5, 0.5]\n\
        [[obstacle]]\ncorner = [50.0, 0.0]\nsize = [0.5, 0.8]\n";
    let motion = Motion {
        constraints: Constraints::new(&Scene::parse(text, "scene.toml")?),
        fall: [0.0; 2],
        start: 0.0,
        interval: 0.01,
        mirror: false,
        packing: CrowdingLimit::new(config.connection_radius, SPACING),
    };
    let positions = column(points);
    let window = vec![positions.clone(); config.window()];
    let bounds = motion.constraints.domain().map(|length| [0.0, length]);

    let mut builder = FrameBuilder::new(device, config, norm, &bounds, &[points], 1)?;
    builder.set_statics(&statics)?;
    let single: Vec<f32> = positions.as_flattened().iter().map(|&x| x as f32).collect();
    let position = device.upload(&single)?;
    let mut frame = builder.allocate(48 * points)?;
    // Positions of three frames: an acceleration may be a feature.
    let past = [0; 3].map(|_| position.as_view());
    let mut new = [NewFrame { past: &past, known: 3, back: 0, frame: &mut frame }];
    let graph = time(device, || builder.graphs(&mut new))?;
    let edges = builder.needed()?;
    let features = time(device, || builder.features(&mut new))?;

    let mut integrator = Integrator::new(device, config, norm, &motion, points)?;
    integrator.begin([&positions, &positions], 6)?;
    let output = device.zeros(2 * points)?;
    let mut moved = device.zeros(2 * points)?;
    let integrate = time(device, || integrator.step(&output, &mut moved, 0))?;

    let still = &Normalisation { acceleration_std: vec![1e-15; 2], ..norm.clone() };
    let next = window.len();
    let start = || Start { motion: motion.clone(), window: &window, statics: &statics, next };
    let (frame, _) = rollout(device, config, still, start(), Rest(device.zeros(2 * points)?))?;
    let whole = |precision| {
        let room = Capacity { points, edges: 1 };
        let mut network = CudaNetwork::new(device, config, precision, room, false)?;
        network.set_weights(&timed.weights)?;
        rollout(device, config, still, start(), network)
    };
    let [(f32, f32_memory), (bf16, bf16_memory)] =
        [whole(Precision::F32)?, whole(Precision::Bf16)?];

    let mut batches = BatchBuilder::new(device, config, norm, &bounds)?;
    let twice = vec![single.repeat(config.window()); 2];
    let members = Batch {
        windows: twice,
        points: vec![points; 2],
        statics: vec![statics.clone(); 2],
        obstacles: vec![Vec::new(); 2],
        targets: single.repeat(2),
    };
    let members = HostWindows::new(members, None);
    batches.make(&members, |_, _| Ok(()))?;
    let began = Instant::now();
    for _ in 0..BLOCKS {
        batches.make(&members, |_, _| Ok(()))?;
    }
    let batch = began.elapsed().as_secs_f64() * 1e6 / BLOCKS as f64;

    println!(
        "{points:>7} {edges:>9} {graph:>8.1} {features:>9.1} {integrate:>9.1} {frame:>10.1} \
         {f32:>9.0} {bf16:>9.0} {f32_memory:>9.0} {bf16_memory:>9.0} {batch:>9.0}"
    );
    Ok(())
}

/// Microseconds of a frame of a rollout, copies to the host included, and MiB of the GPU's memory.
fn rollout<N: Network>(
    device: &Arc<Device>,
    config: &ModelConfig,
    norm: &Normalisation,
    start: Start,
    network: N,
) -> Result<(f64, f64), Failure> {
    device.stream().synchronize()?;
    let (free, _) = device.context().mem_get_info()?;
    let mut rollout = CudaRollout::new(device, config, norm, vec![start], network)?;
    // All of its CUDA graphs are made in the first blocks.
    let warm_up = 2 * config.window() / BLOCK + 2;
    (0..warm_up).try_for_each(|_| rollout.block().map(|_| ()))?;
    let began = Instant::now();
    (0..BLOCKS).try_for_each(|_| rollout.block().map(|_| ()))?;
    let time = began.elapsed().as_secs_f64() * 1e6 / (BLOCKS * BLOCK) as f64;
    let (left, _) = device.context().mem_get_info()?;
    Ok((time, free.saturating_sub(left) as f64 / f64::from(1 << 20)))
}
