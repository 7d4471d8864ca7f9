//! Time of a training step and of a predicted frame at the size of the paper's Baseline, on a GPU.
//!
//! `network_bench [FOLDER]`; in FOLDER it leaves weights, input, output and gradient for
//! `benches/torch_reference.py`, which computes and times the same in PyTorch.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use gpu::Device;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use safetensors::tensor::{Dtype, TensorView, serialize_to_file};
use surrogate::cuda::{
    BatchBuilder, Capacity, CudaError, CudaNetwork, CudaTrainer, EDGES_PER_POINT, FrameInput,
    HostInput, HostWindows, Rates, Targets, upload,
};
use surrogate::data::{Batch, Unrolling};
use surrogate::features::{HostFrame, Normalisation, Window, host_frames};
use surrogate::network::Model;
use surrogate::network::burn_backend::device as cpu;
use surrogate::network::parameters::weights;
use surrogate::network::{ModelConfig, Precision};

/// Points of a side of the column, 1/16 m apart.
const SIDE: usize = 48;
const POINTS: usize = SIDE * SIDE;
/// Windows of a batch; what is left for PyTorch is of this one.
const WINDOWS: usize = 2;
const REPEATS: usize = 50;

fn normalisation() -> Normalisation {
    Normalisation::about_zero(2, 0.004, 1e-3)
}

/// Jittered columns in random motion.
fn windows(config: &ModelConfig, count: usize) -> Vec<Vec<f32>> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut window = || -> Vec<f32> {
        let mut start = Vec::new();
        let mut step = Vec::new();
        for k in 0..POINTS {
            for place in [k % SIDE, k / SIDE] {
                start.push((place as f32 + 0.5 + rng.random_range(-0.1..0.1)) / 16.0);
                step.push(rng.random_range(-0.004..0.004));
            }
        }
        let at =
            |k: usize| start.iter().zip(&step).map(move |(x, v): (&f32, &f32)| x + k as f32 * v);
        (0..config.frames).flat_map(at).collect()
    };
    (0..count).map(|_| window()).collect()
}

struct Scene {
    windows: usize,
    config: ModelConfig,
    weights: Vec<f32>,
    host: Vec<HostFrame>,
    target: Vec<f32>,
}

impl Scene {
    fn new(count: usize) -> Self {
        let config = ModelConfig::default();
        let positions = windows(&config, count);
        let windows: Vec<Window> = positions
            .iter()
            .map(|positions| Window { positions, points: POINTS, statics: &[], obstacles: &[] })
            .collect();
        let began = Instant::now();
        let host = host_frames(&windows, &config, &normalisation(), &[[0.0, 10.0]; 2]);
        println!("graphs and features on the CPU: {:.1} ms", ms(began));
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let target = (0..2 * count * POINTS).map(|_| rng.random_range(-1.0..1.0)).collect();
        let model = Model::<surrogate::network::burn_backend::Cpu>::new(&config, 3, &cpu());
        Self { windows: count, weights: weights(&model), config, host, target }
    }

    fn capacity(&self) -> Capacity {
        let edges = self.host.iter().map(|frame| frame.pairs.len()).max().unwrap_or(1);
        Capacity { points: self.windows * POINTS, edges }
    }

    fn uploaded(&self, device: &Arc<Device>) -> Result<Vec<FrameInput>, Box<dyn Error>> {
        let room = self.capacity().edges;
        let frames = self.host.iter().map(|f| upload(device, &HostInput::from(f.clone()), room));
        Ok(frames.collect::<Result<_, _>>()?)
    }
}

fn ms(since: Instant) -> f64 {
    1e3 * since.elapsed().as_secs_f64()
}

fn print_profile(profile: &[(&str, usize, f32)]) {
    for (name, launches, time) in profile {
        println!("    {name:<18} {launches:>4} launches {time:>8.3} ms");
    }
    println!("    {:<18} {:>22.3} ms", "sum", profile.iter().map(|p| p.2).sum::<f32>());
}

/// Times training steps; gives output and gradient at the start.
fn train(
    device: &Arc<Device>,
    scene: &Scene,
    precision: Precision,
) -> Result<[Vec<f32>; 2], Box<dyn Error>> {
    let stream = device.stream();
    let frames = scene.uploaded(device)?;
    let target = device.upload(&scene.target)?;
    let targets = Targets::of_all(&target, &frames);
    let zeros = vec![0.0; scene.weights.len()];
    let mut trainer =
        CudaTrainer::new(device, &scene.config, precision, scene.capacity(), false, None)?;
    trainer.restore(&scene.weights, [&zeros, &zeros], None)?;
    let (_, gradient) = trainer.gradient(&frames, targets)?;
    let output = trainer.network().forward(&frames)?;
    let output = stream.clone_dtoh(output)?;
    let rates = Rates { rate: 1e-4, corrections: [1.0; 2], decay: 0.0 };
    let mut step = || trainer.step(&frames, targets, rates);
    (0..5).try_for_each(|_| step())?;
    stream.synchronize()?;
    let mut times = Vec::new();
    for _ in 0..5 {
        let began = Instant::now();
        (0..REPEATS).try_for_each(|_| step())?;
        stream.synchronize()?;
        times.push(ms(began) / REPEATS as f64);
    }
    times.sort_by(f64::total_cmp);
    let losses = trainer.losses(256)?;
    println!(
        "{precision:?} training step, batch {}: {:.3} ms ({:.3} to {:.3}); loss {:.4} -> {:.4}",
        scene.windows,
        times[2],
        times[0],
        times[4],
        losses[0],
        losses[losses.len() - 1]
    );
    trainer.profile(&frames, targets)?;
    print_profile(&trainer.profile(&frames, targets)?);
    Ok([output, gradient])
}

/// Times training steps with all that belongs to them, batches and their graphs too; without and with
/// frames that the network predicts before it learns (pushforward).
fn train_all_in(
    device: &Arc<Device>,
    scene: &Scene,
    precision: Precision,
) -> Result<(), Box<dyn Error>> {
    let config = &scene.config;
    let positions = windows(config, scene.windows);
    let edges = EDGES_PER_POINT * scene.capacity().points;
    let room = Capacity { edges, ..scene.capacity() };
    let zeros = vec![0.0; scene.weights.len()];
    let mut trainer = CudaTrainer::new(device, config, precision, room, true, None)?;
    trainer.restore(&scene.weights, [&zeros, &zeros], Some(&scene.weights))?;
    let mut batches = BatchBuilder::new(device, config, &normalisation(), &[[0.0, 10.0]; 2])?;
    let rates = Rates { rate: 1e-4, corrections: [1.0; 2], decay: 0.9 };
    for unroll in [0, 8] {
        let frames = |last: usize| {
            let at = 2 * POINTS * (config.frames - last)..2 * POINTS * (config.frames + 1 - last);
            positions
                .iter()
                .flat_map(move |w| w[at.clone()].iter().map(|&x| f64::from(x)))
                .collect()
        };
        let last_two: [Vec<f64>; 2] = [frames(2), frames(1)];
        let (mean, std) = (vec![[0.0; 2]; scene.windows], [1e-3; 2]);
        let unrolling = Unrolling { steps: unroll, truth: last_two.clone(), last_two, mean, std };
        let batch = Batch {
            windows: positions.clone(),
            points: vec![POINTS; scene.windows],
            statics: vec![Vec::new(); scene.windows],
            obstacles: vec![Vec::new(); scene.windows],
            targets: scene.target.clone(),
        };
        let host = HostWindows::new(batch, Some(unrolling).filter(|_| unroll > 0));
        let mut step = || -> Result<(), CudaError> {
            let batch = batches
                .make(&host, |input, predicted| trainer.predict_windows(input, predicted))?;
            trainer.step(&batch.frames, Targets::of_all(&batch.targets, &batch.frames), rates)
        };
        (0..10).try_for_each(|_| step())?;
        device.stream().synchronize()?;
        let steps = if precision == Precision::Bf16 { 1000 } else { 450 } / (1 + unroll);
        let began = Instant::now();
        (0..steps).try_for_each(|_| step())?;
        device.stream().synchronize()?;
        println!(
            "{precision:?} step with its batch of {}, {unroll} frames predicted: {:.3} ms",
            scene.windows,
            ms(began) / steps as f64
        );
    }
    Ok(())
}

/// Times predicted frames of one window.
fn predict(
    device: &Arc<Device>,
    scene: &Scene,
    precision: Precision,
) -> Result<(), Box<dyn Error>> {
    let stream = device.stream();
    let positions = windows(&scene.config, 1);
    let window =
        [Window { positions: &positions[0], points: POINTS, statics: &[], obstacles: &[] }];
    let host = host_frames(&window, &scene.config, &normalisation(), &[[0.0, 10.0]; 2]);
    let edges = host.iter().map(|frame| frame.pairs.len()).max().unwrap_or(1);
    let newest = host.len() - 1;
    let [frame, before] = [newest, newest - 1].map(|k| HostInput::from(host[k].clone()));
    let (frame, before) = (upload(device, &frame, edges)?, upload(device, &before, edges)?);
    let room = Capacity { points: POINTS, edges };
    let mut network = CudaNetwork::new(device, &scene.config, precision, room, false)?;
    network.set_weights(&scene.weights)?;
    for _ in 0..5 {
        network.advance(&frame, &before)?;
    }
    stream.synchronize()?;
    let began = Instant::now();
    for _ in 0..REPEATS {
        network.advance(&frame, &before)?;
    }
    stream.synchronize()?;
    let launched = ms(began) / REPEATS as f64;
    // The same as a CUDA graph.
    use cudarc::driver::sys::{CUgraphInstantiate_flags, CUstreamCaptureMode};
    stream.begin_capture(CUstreamCaptureMode::CU_STREAM_CAPTURE_MODE_THREAD_LOCAL)?;
    let queued = network.advance(&frame, &before).map(|_| ());
    let graph = stream.end_capture(CUgraphInstantiate_flags(0))?;
    queued?;
    let mut replayed = f64::NAN;
    if let Some(graph) = graph {
        graph.launch()?;
        stream.synchronize()?;
        let began = Instant::now();
        (0..REPEATS).try_for_each(|_| graph.launch())?;
        stream.synchronize()?;
        replayed = ms(began) / REPEATS as f64;
    }
    println!(
        "{precision:?} predicted frame: {replayed:.3} ms as a graph, {launched:.3} ms launched"
    );
    print_profile(&network.profile_advance(&frame, &before)?);
    Ok(())
}

/// Everything that PyTorch needs to compute the same.
fn write(
    folder: &Path,
    scene: &Scene,
    results: &[(Precision, [Vec<f32>; 2])],
) -> Result<(), Box<dyn Error>> {
    let model = Model::<surrogate::network::burn_backend::Cpu>::new(&scene.config, 3, &cpu());
    surrogate::network::weights::save(
        &folder.join("weights.safetensors"),
        &model,
        &scene.config,
        &normalisation(),
        Default::default(),
    )?;
    let mut tensors: Vec<(String, Dtype, Vec<usize>, Vec<u8>)> = Vec::new();
    let bytes = |list: &[f32]| list.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    for (k, frame) in scene.host.iter().enumerate() {
        let [node, edge] = frame.columns;
        let (points, edges) = (frame.points, frame.pairs.len());
        tensors.push((format!("node{k}"), Dtype::F32, vec![points, node], bytes(&frame.nodes)));
        tensors.push((format!("edge{k}"), Dtype::F32, vec![edges, edge], bytes(&frame.edges)));
        let ends = |which: fn(&(i32, i32)) -> i32| -> Vec<u8> {
            frame.pairs.iter().flat_map(|p| i64::from(which(p)).to_le_bytes()).collect()
        };
        tensors.push((format!("sender{k}"), Dtype::I64, vec![edges], ends(|p| p.1)));
        tensors.push((format!("receiver{k}"), Dtype::I64, vec![edges], ends(|p| p.0)));
    }
    let outputs = vec![scene.target.len() / 2, 2];
    tensors.push(("target".into(), Dtype::F32, outputs.clone(), bytes(&scene.target)));
    for (precision, [output, gradient]) in results {
        let name = format!("{precision:?}").to_lowercase();
        tensors.push((format!("output_{name}"), Dtype::F32, outputs.clone(), bytes(output)));
        let count = vec![gradient.len()];
        tensors.push((format!("gradient_{name}"), Dtype::F32, count, bytes(gradient)));
    }
    let views = tensors
        .iter()
        .map(|(name, dtype, shape, bytes)| {
            Ok((name.clone(), TensorView::new(*dtype, shape.clone(), bytes)?))
        })
        .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()?;
    Ok(serialize_to_file(views, None, &folder.join("bench.safetensors"))?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let device = Device::new(0)?;
    let one = Scene::new(1);
    train(&device, &one, Precision::Bf16)?;
    train_all_in(&device, &one, Precision::Bf16)?;
    let scene = Scene::new(WINDOWS);
    println!(
        "{}: {POINTS} points, {} edges in the frames of a batch of {WINDOWS}",
        device.name(),
        scene.capacity().edges
    );
    let mut results = Vec::new();
    for precision in [Precision::Bf16, Precision::F32] {
        results.push((precision, train(&device, &scene, precision)?));
        train_all_in(&device, &scene, precision)?;
        predict(&device, &scene, precision)?;
    }
    if let Some(folder) = std::env::args_os().nth(1).map(PathBuf::from) {
        std::fs::create_dir_all(&folder)?;
        write(&folder, &scene, &results)?;
    }
    Ok(())
}
