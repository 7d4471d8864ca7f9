//! Graphs, features, training batches and rollouts on a GPU against their CPU twins.
//!
//! Without a GPU these tests say so and pass, unless `DEMPM_REQUIRE_GPU=1`.

use std::sync::Arc;

use burn::backend::Flex;
use burn::tensor::Tensor;
use cudarc::driver::{CudaFunction, CudaSlice, LaunchConfig, PushKernelArg};
use dempm::scene::{Plate, Rectangle, Scene};
use gpu::{Device, compile};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rstest::rstest;
use surrogate::cuda::{
    BLOCK, BatchBuilder, Capacity, CudaError, CudaNetwork, CudaRollout, FrameBuilder, FrameInput,
    Frames, GraphBuilder, HostWindows, Motion, Network, NewFrame, Past, Source, features_source,
    graph_source, integrate_source, push_forward_source,
};
use surrogate::data::Batch;
use surrogate::diagnostics::CrowdingLimit;
use surrogate::features::{
    Normalisation, Obstacle, RadiusGraph, Window, radius_graph, window_input,
};
use surrogate::network::parameters::weights;
use surrogate::network::{DIMENSIONS, Model, NodeFeature};
use surrogate::network::{ModelConfig, Precision};
use surrogate::rollout::Constraints;
use surrogate::rollout::RolloutError;
use surrogate::simulator::{Simulator, Training};

const RADIUS: f32 = 0.25;

fn normalisation() -> Normalisation {
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
const FEATURES: [NodeFeature; 6] = [
    NodeFeature::Overburden,
    NodeFeature::Acceleration,
    NodeFeature::Surfaces,
    NodeFeature::InitialStress,
    NodeFeature::InitialSolidFraction,
    NodeFeature::Material,
];
/// Columns of those that do not change.
const STATICS: usize = 7;

/// The normalisation of a network, with or without further features.
fn normalisation_for(config: &ModelConfig) -> Normalisation {
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
fn readers() -> [ModelConfig; 4] {
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
fn statics(config: &ModelConfig, points: usize) -> Vec<f32> {
    if config.node_features.is_empty() { Vec::new() } else { random(points, STATICS, 1.0, 11) }
}

/// Two obstacles beside each other in the middle of the unit box, and a plate that has begun to come
/// down.
fn obstacles(config: &ModelConfig) -> Vec<Obstacle> {
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

fn random(points: usize, columns: usize, extent: f32, seed: u64) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..points * columns).map(|_| rng.random_range(0.0..extent)).collect()
}

/// The graphs of several windows side by side.
fn reference(windows: &[Vec<f32>]) -> RadiusGraph {
    let mut whole = RadiusGraph { start: vec![0], sender: Vec::new() };
    for window in windows {
        let graph = radius_graph(window, RADIUS);
        let (points, edges) = (whole.start.len() as u32 - 1, whole.sender.len() as u32);
        whole.start.extend(graph.start[1..].iter().map(|start| start + edges));
        whole.sender.extend(graph.sender.iter().map(|sender| sender + points));
    }
    whole
}

/// Builds the graph of some windows and compares it edge by edge; the room is too small at first.
fn check_graph(windows: &[Vec<f32>]) {
    let Some(device) = gpu::for_tests() else { return };
    let expected = reference(windows);
    let points: Vec<usize> = windows.iter().map(|window| window.len() / DIMENSIONS).collect();
    let mut builder = GraphBuilder::new(&device, RADIUS, &points, 1).unwrap();
    let mut positions = windows.concat();
    let values = positions.len();
    positions.push(0.0); // an empty upload is an error
    let positions = device.upload(&positions).unwrap();
    if expected.edges() > 0 {
        let mut small = builder.allocate(expected.edges() - 1).unwrap();
        builder.build(&mut [(positions.slice(..values), &mut small)]).unwrap();
        assert_eq!(builder.needed().unwrap(), expected.edges());
        let stream = device.stream();
        assert_eq!(stream.clone_dtoh(&small.edges).unwrap(), [0], "no half of a graph");
        assert!(stream.clone_dtoh(&small.start).unwrap().iter().all(|&start| start == 0));
    }
    for capacity in [expected.edges(), 2 * expected.edges() + 100] {
        let mut graph = builder.allocate(capacity).unwrap();
        // The second time over what the first one left.
        for _ in 0..2 {
            builder.build(&mut [(positions.slice(..values), &mut graph)]).unwrap();
        }
        assert_eq!(builder.needed().unwrap(), expected.edges());
        assert_eq!(builder.needed().unwrap(), 0, "since the last call");
        let stream = device.stream();
        let read = |array: &CudaSlice<u32>| {
            let mut list = stream.clone_dtoh(array).unwrap();
            list.truncate(expected.edges());
            list
        };
        assert_eq!(stream.clone_dtoh(&graph.edges).unwrap(), [expected.edges() as u32]);
        let nodes = expected.start.len() - 1;
        assert_eq!(stream.clone_dtoh(&graph.nodes).unwrap(), [nodes as u32]);
        assert_eq!(stream.clone_dtoh(&graph.start).unwrap()[..=nodes], expected.start);
        let (sender, receiver) = (read(&graph.sender), read(&graph.receiver));
        assert_eq!(sender, expected.sender);
        let receivers: Vec<u32> = expected.pairs().map(|(receiver, _)| receiver as u32).collect();
        assert_eq!(receiver, receivers);
        for (edge, &back) in read(&graph.reverse).iter().enumerate() {
            let back = back as usize;
            assert_eq!((sender[back], receiver[back]), (receiver[edge], sender[edge]));
        }
    }
}

#[rstest]
fn graphs_of_random_points(#[values(1, 2, 31, 33, 500, 3000)] points: usize) {
    for (seed, extent) in [(1, 0.3), (2, 2.0), (3, 10.0)] {
        check_graph(&[random(points, DIMENSIONS, extent, seed)]);
    }
}

#[test]
fn graphs_of_special_points() {
    let line = |xs: &[f32]| -> Vec<f32> { xs.iter().flat_map(|&x| [x, 0.5]).collect() };
    check_graph(&[Vec::new()]);
    check_graph(&[line(&[1.0])]);
    // All at one place: each is a neighbour of all.
    check_graph(&[line(&[0.7; 100])]);
    // At exactly the radius, and the next number beyond; on borders of cells, about zero.
    check_graph(&[line(&[1.0, 1.25, 1.5, 1.750_000_1, -0.25, 0.0, 0.25, -0.0])]);
    let width = 0.25 * 1.001;
    let borders: Vec<f32> = (-20..20).map(|k| k as f32 * width).collect();
    check_graph(&[line(&borders)]);
    // Far away and nowhere.
    let far = [f32::NAN, 1.0, 1.1, f32::INFINITY, 1e30, -1e30, 1e9, 1e9, -3e7, -3e7, f32::MAX, 1.2];
    check_graph(&[line(&far)]);
    // 16 cells apart, so that they share buckets.
    check_graph(&[line(&[0.1, 0.1 + 16.0 * width, 0.1 + 8.0 * width, 0.2])]);
    // Dense clusters in a wide domain.
    let mut clusters = random(400, DIMENSIONS, 0.2, 4);
    clusters.extend(random(400, DIMENSIONS, 0.2, 5).iter().map(|x| x + 900.0));
    check_graph(&[clusters]);
}

/// Differences of coordinates of thousands of cells, where single precision could part neighbours by
/// two cells.
#[test]
fn graphs_far_from_the_origin() {
    for shift in [1.0e3, 1.0e4, 1.0e5] {
        let cloud: Vec<f32> = random(2000, DIMENSIONS, 4.0, 6).iter().map(|x| x + shift).collect();
        check_graph(&[cloud]);
    }
}

#[test]
fn graphs_of_batches() {
    let sizes = [300, 0, 1, 2304, 77];
    let windows: Vec<Vec<f32>> =
        sizes.iter().enumerate().map(|(k, &n)| random(n, DIMENSIONS, 2.0, k as u64)).collect();
    check_graph(&windows);
}

/// The paper's scene and larger ones.
#[test]
fn graphs_of_lattices() {
    for (columns, rows) in [(48, 48), (400, 250)] {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let place = |k: usize| (k as f32 + 0.5) / 16.0;
        let lattice = (0..columns * rows).flat_map(|k| [place(k % columns), place(k / columns)]);
        let lattice = lattice.map(|x| x + rng.random_range(-0.02..0.02)).collect();
        check_graph(&[lattice]);
    }
}

/// Positions of frames of a cloud that drifts.
fn drifting(points: usize, frames: usize, seed: u64) -> Vec<f32> {
    let start = random(points, DIMENSIONS, 1.0, seed);
    let drift = random(points, DIMENSIONS, 0.02, seed + 100);
    (0..frames)
        .flat_map(|k| start.iter().zip(&drift).map(move |(x, v)| x + k as f32 * (v - 0.01)))
        .collect()
}

fn rows(tensor: &Tensor<Flex, 2>) -> Vec<f32> {
    tensor.to_data().iter::<f32>().collect()
}

/// Compares features to the bit.
fn check_frames(
    device: &Device,
    frames: &[FrameInput],
    windows: &[Window],
    config: &ModelConfig,
    norm: &Normalisation,
    bounds: &[[f64; 2]],
) {
    let expected = window_input::<Flex>(windows, config, norm, bounds, &Default::default());
    assert_eq!(frames.len(), expected.frames.len());
    for (found, expected) in frames.iter().zip(&expected.frames) {
        let mut node = device.stream().clone_dtoh(&found.node).unwrap();
        let mut edge = device.stream().clone_dtoh(&found.edge).unwrap();
        let (nodes, edges) = (rows(&expected.nodes), rows(&expected.edges));
        node.truncate(nodes.len());
        edge.truncate(edges.len());
        assert_eq!(node, nodes);
        assert_eq!(edge, edges);
    }
}

#[test]
fn features_match() {
    // As many as the longest window.
    const FRAMES: usize = 5;
    let Some(device) = gpu::for_tests() else { return };
    let bounds = vec![[0.0, 1.0]; DIMENSIONS];
    let sizes = [150, 300];
    let windows: Vec<Vec<f32>> = sizes
        .iter()
        .enumerate()
        .map(|(k, &n)| {
            let mut window = drifting(n, FRAMES, k as u64);
            // Two points at one place in all frames.
            for frame in window.chunks_exact_mut(n * DIMENSIONS) {
                frame.copy_within(0..DIMENSIONS, DIMENSIONS);
            }
            window
        })
        .collect();
    let at = |k: usize| -> CudaSlice<f32> {
        let parts = windows
            .iter()
            .zip(sizes)
            .map(|(window, n)| &window[k * n * DIMENSIONS..(k + 1) * n * DIMENSIONS]);
        device.upload(&parts.collect::<Vec<_>>().concat()).unwrap()
    };
    let positions: Vec<_> = (0..FRAMES).map(at).collect();
    for config in readers() {
        let norm = normalisation_for(&config);
        let mut builder = FrameBuilder::new(&device, &config, &norm, &bounds, &sizes, 1).unwrap();
        let statics = sizes.map(|points| statics(&config, points));
        builder.set_statics(&statics.concat()).unwrap();
        let obstacles = [Vec::new(), obstacles(&config)];
        builder.set_obstacles(&obstacles).unwrap();
        let oldest = FRAMES - config.window();
        let frames: Vec<FrameInput> = (FRAMES - config.graphs()..FRAMES)
            .map(|k| {
                let mut frame = builder.allocate(450 * 449).unwrap();
                // A GNS knows all frames, a TGNNS the one before, if there is one.
                let known = if config.graphs() == 1 { 3 } else { (k + 4 - FRAMES).min(2) };
                let past: Vec<_> = positions[oldest..=k].iter().map(|x| x.as_view()).collect();
                let back = FRAMES - 1 - k;
                let mut new = [NewFrame { past: &past, known, back, frame: &mut frame }];
                builder.graphs(&mut new).unwrap();
                builder.features(&mut new).unwrap();
                frame
            })
            .collect();
        let windows: Vec<Window> = windows
            .iter()
            .zip(sizes)
            .zip(&statics)
            .zip(&obstacles)
            .map(|(((positions, points), statics), obstacles)| {
                let positions = &positions[oldest * points * DIMENSIONS..];
                Window { positions, points, statics, obstacles }
            })
            .collect();
        check_frames(&device, &frames, &windows, &config, &norm, &bounds);
    }
}

#[test]
fn batches_match() {
    let Some(device) = gpu::for_tests() else { return };
    let bounds = [[0.0, 1.0]; 2];
    // Of the last one more frames than are made in one launch.
    let long = ModelConfig { frames: 9, ..ModelConfig::default() };
    for config in readers().into_iter().chain([long]) {
        let norm = normalisation_for(&config);
        let mut builder = BatchBuilder::new(&device, &config, &norm, &bounds).unwrap();
        // More edges than there is room for at first, smaller and larger ones, each place twice.
        for sizes in [[200, 350], [40, 30], [350, 200], [7, 400], [200, 350]] {
            let batch = Batch {
                windows: (0..2).map(|k| drifting(sizes[k], config.window(), k as u64)).collect(),
                points: sizes.to_vec(),
                statics: sizes.iter().map(|&points| statics(&config, points)).collect(),
                obstacles: vec![obstacles(&config), Vec::new()],
                targets: random(sizes.iter().sum(), DIMENSIONS, 1.0, 8),
            };
            let host = HostWindows::new(batch.clone(), None);
            let made = builder.make(&host, |_, _| panic!("nothing is moved on")).unwrap();
            assert_eq!(made.values, batch.targets.len());
            let targets = device.stream().clone_dtoh(&made.targets).unwrap();
            assert_eq!(targets[..made.values], batch.targets);
            let windows: Vec<Window> = (0..2)
                .map(|k| Window {
                    positions: &batch.windows[k],
                    points: sizes[k],
                    statics: &batch.statics[k],
                    obstacles: &batch.obstacles[k],
                })
                .collect();
            check_frames(&device, &made.frames, &windows, &config, &norm, &bounds);
        }
    }
}

/// Accelerations that depend on all that a network reads, in sums of fixed order.
const STAND_IN: &str = r#"
extern "C" __global__ void stand_in(
    unsigned points, const unsigned* start, const float* node, const float* edge,
    const float* before_node, unsigned columns, float scale, float* output) {
    const unsigned point = blockIdx.x * blockDim.x + threadIdx.x;
    if (point >= points) {
        return;
    }
    for (int k = 0; k < 2; ++k) {
        float sum = 0.0f;
        for (unsigned e = start[point]; e < start[point + 1]; ++e) {
            // Repulsion and drag.
            const float push = __fmul_rn(edge[5 * e + 2 + k], edge[5 * e + 4] - 1.0f);
            sum = __fadd_rn(sum, __fadd_rn(push, __fmul_rn(0.1f, edge[5 * e + k])));
        }
        const float *now = node + columns * point, *before = before_node + columns * point;
        float walls = before[2 + 2 * k] - now[2 + 2 * k];
        for (unsigned column = 6; column < columns; ++column) {
            walls = __fadd_rn(walls, now[column]);
        }
        output[2 * point + k] = __fmul_rn(scale, __fadd_rn(sum, walls));
    }
}
"#;

/// What [`STAND_IN`] computes.
fn stand_in(windows: &[Window], config: &ModelConfig, scale: f32) -> Vec<f32> {
    let input = window_input::<Flex>(
        windows,
        config,
        &normalisation_for(config),
        &[[0.0, 4.0], [0.0, 2.0]],
        &Default::default(),
    );
    let newest = &input.frames[config.frames - 1];
    let (node, edge) = (rows(&newest.nodes), rows(&newest.edges));
    let before = rows(&input.frames[config.frames - 2].nodes);
    let columns = config.later_node_features();
    let points = windows[0].points;
    let last = &windows[0].positions[(config.frames - 1) * 2 * points..];
    let graph = radius_graph(last, RADIUS);
    let mut output = Vec::new();
    for point in 0..points {
        for k in 0..2 {
            let mut sum = 0.0_f32;
            for e in graph.start[point] as usize..graph.start[point + 1] as usize {
                let push = edge[5 * e + 2 + k] * (edge[5 * e + 4] - 1.0);
                sum += push + 0.1 * edge[5 * e + k];
            }
            let now = &node[columns * point..columns * (point + 1)];
            let mut walls = before[columns * point + 2 + 2 * k] - now[2 + 2 * k];
            now[6..].iter().for_each(|surface| walls += surface);
            output.push(scale * (sum + walls));
        }
    }
    output
}

/// The stand-in as a network.
struct StandIn {
    device: Arc<Device>,
    kernel: CudaFunction,
    /// Features of a node.
    columns: u32,
    scale: f32,
    output: CudaSlice<f32>,
    calls: usize,
}

impl StandIn {
    fn new(device: &Arc<Device>, config: &ModelConfig, points: usize, scale: f32) -> Self {
        let module = device.module("stand_in.cu", STAND_IN, &[]).unwrap();
        let kernel = module.load_function("stand_in").unwrap();
        let output = device.zeros(2 * points).unwrap();
        let columns = config.later_node_features() as u32;
        Self { device: device.clone(), kernel, columns, scale, output, calls: 0 }
    }
}

impl Network for StandIn {
    fn reserve(&mut self, _: usize, _: usize) -> Result<(), CudaError> {
        self.calls = 0;
        Ok(())
    }

    fn accelerations(
        &mut self,
        frame: &FrameInput,
        before: &FrameInput,
    ) -> Result<&CudaSlice<f32>, CudaError> {
        self.calls += 1;
        // For the four frames of the window, then captured in each of four phases.
        assert!(self.calls <= 8, "called instead of replayed");
        let points = frame.graph.points as u32;
        let mut launch = self.device.stream().launch_builder(&self.kernel);
        launch.arg(&points).arg(&frame.graph.start).arg(&frame.node).arg(&frame.edge);
        launch.arg(&before.node).arg(&self.columns).arg(&self.scale).arg(&self.output);
        // SAFETY: the arguments are those of the kernel.
        unsafe { launch.launch(LaunchConfig::for_num_elems(points)) }?;
        Ok(&self.output)
    }
}

/// A wall-bounded box with obstacles of all kinds of faces, and a plate that comes down.
fn scene() -> Scene {
    let text = "duration = 1.0\n[material]\nkind = \"mu-i\"\n[domain]\nsize = [4.0, 2.0]\n\
        [[column]]\nsize = [0.5, 0.5]\n\
        [[obstacle]]\ncorner = [1.0, 0.0]\nsize = [0.5, 0.8]\n\
        faces = { left = \"slip\", right = \"stick\", top = 0.5, bottom = 0.5 }\n\
        [[obstacle]]\ncorner = [2.5, 0.7]\nsize = [0.6, 0.3]\n\
        faces = { left = 0.2, right = 0.3, top = \"stick\", bottom = \"slip\" }\n\
        [plate]\ncorner = [0.2, 1.2]\nsize = [0.7, 0.4]\nvelocity = [0.1, -2.0]\nstart = 0.2\n";
    Scene::parse(text, "scene.toml").unwrap()
}

fn motion() -> Motion {
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
fn start(points: usize, frames: usize, spread: f64) -> Vec<Vec<[f64; 2]>> {
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

/// A network that the stand-in takes the place of: it sees all boxes.
fn stand_in_config(frames: usize) -> ModelConfig {
    let node_features = vec![NodeFeature::Surfaces];
    ModelConfig { frames, obstacles: true, node_features, ..ModelConfig::default() }
}

/// The boxes in the frame before this one.
fn boxes_before(motion: &Motion, frame: usize) -> Vec<Obstacle> {
    let time = motion.start + (frame - 1) as f64 * motion.interval;
    motion.constraints.obstacles(time, motion.interval)
}

/// One frame of the rollout as `Rollout::advance` makes it, with the stand-in.
fn advance(
    window: &[Vec<[f64; 2]>],
    obstacles: &mut [Obstacle],
    motion: &Motion,
    frame: usize,
    scale: f32,
) -> Vec<[f64; 2]> {
    let config = stand_in_config(window.len());
    let positions = &single(window);
    let windows = [Window { positions, points: window[0].len(), statics: &[], obstacles }];
    let norm = normalisation();
    let output = stand_in(&windows, &config, scale);
    obstacles.iter_mut().for_each(Obstacle::advance);
    let accelerations: Vec<f64> = output
        .iter()
        .enumerate()
        .map(|(place, &a)| {
            let k = place % 2;
            f64::from(a) * norm.acceleration_std[k] + norm.acceleration_mean[k] + motion.fall[k]
        })
        .collect();
    integrate(window, motion, frame, &accelerations)
}

fn single(window: &[Vec<[f64; 2]>]) -> Vec<f32> {
    window.iter().flatten().flatten().map(|&x| x as f32).collect()
}

/// The frame that follows from accelerations (m/frame²).
fn integrate(
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

/// Rolls a random network out on the device: each frame is what the simulator on the processor makes
/// of those before it.
fn roll_out(config: ModelConfig, precision: Precision, mirror: bool, blocks: usize) {
    let Some(device) = gpu::for_tests() else { return };
    // No box in the way: a rough one holds a point that touches it, and rounding decides which does. A
    // plate within sight moves away faster than the points.
    let place = Rectangle { corner: [0.5, 1.3], size: [1.5, 0.3] };
    let faces = scene().plate.unwrap().faces;
    let plate = Some(Plate { place, velocity: [0.2, 3.0], start: 0.05, faces });
    let scene = Scene { obstacles: Vec::new(), plate, ..scene() };
    // Falling to one side, which the image does to the other.
    let fall = [5e-4, -9.81e-4];
    let motion = Motion { constraints: Constraints::new(&scene), fall, mirror, ..motion() };
    let norm = normalisation_for(&config);
    let model = Model::<Flex>::new(&config, 5, &Default::default());
    let mut window = start(300, config.window(), 0.7);
    let statics = &statics(&config, 300)[..];
    let room = Capacity { points: 1, edges: 1 };
    let mut network = CudaNetwork::new(&device, &config, precision, room, false).unwrap();
    network.set_weights(&weights(&model)).unwrap();
    let past = Past { window: &window, statics, next: window.len() };
    let mut rollout = CudaRollout::new(&device, &config, &norm, &motion, past, network).unwrap();
    let training = Training::untrained(motion.interval, true);
    let simulator = Simulator { mirror, ..Simulator::new(model, config, norm, training) };
    let mut network = simulator.inference();
    let mut obstacles = boxes_before(&motion, window.len());
    // Of the largest acceleration.
    let tolerance = if precision == Precision::F32 { 1e-4 } else { 0.2 };
    let mut frame = window.len();
    for _ in 0..blocks {
        let (frames, failure) = rollout.block().unwrap();
        assert_eq!(failure, None);
        for found in frames {
            let positions = &single(&window);
            let (points, seen) = (window[0].len(), &obstacles);
            let seen = Window { positions, points, statics, obstacles: seen };
            let domain = motion.constraints.domain();
            let accelerations = simulator.accelerations(&mut network, &seen, domain, motion.fall);
            obstacles.iter_mut().for_each(Obstacle::advance);
            let largest = accelerations.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
            let expected = integrate(&window, &motion, frame, &accelerations);
            let pairs = found.as_flattened().iter().zip(expected.as_flattened());
            let most = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(most <= tolerance * largest, "frame {frame}: {most:e} of {largest:e} m");
            window.remove(0);
            window.push(found);
            frame += 1;
        }
    }
}

#[rstest]
fn networks_roll_out(
    #[values("baseline", "frame4-msg0-hidden1", "frame4-msg1-hidden1-edgemsg", "gns")] name: &str,
    #[values(Precision::F32, Precision::Bf16)] precision: Precision,
) {
    // More frames than it takes until everything comes from CUDA graphs: six and one.
    let config = ModelConfig { gns_layers: 3, ..ModelConfig::named(name).unwrap() };
    roll_out(config, precision, false, 3);
}

#[rstest]
fn mirror_images_and_further_features_roll_out(
    #[values("frame4-msg0-hidden1", "frame4-msg1-hidden1-edgemsg", "gns")] name: &str,
    #[values(false, true)] mirror: bool,
) {
    let config = ModelConfig::named(name).unwrap();
    // The kernels take 32 features of a node: with all of these, a GNS sees five frames.
    let frames = config.frames.min(5);
    let config = ModelConfig { frames, node_features: FEATURES.to_vec(), gns_layers: 3, ..config };
    roll_out(config, Precision::F32, mirror, 3);
}

/// Several blocks, most of them CUDA graphs: to the bit what the CPU makes of them. The points start
/// close together, so that the room for edges is too small and grows.
#[rstest]
fn rollouts_match(#[values(1, 200, 600)] points: usize, #[values(1.0, 0.2)] spread: f64) {
    let Some(device) = gpu::for_tests() else { return };
    let config = stand_in_config(4);
    let (scale, motion) = (0.05, motion());
    let mut window = start(points, config.frames, spread);
    let network = StandIn::new(&device, &config, points, scale);
    let norm = normalisation_for(&config);
    let past = Past { window: &window, statics: &[], next: window.len() };
    let mut rollout = CudaRollout::new(&device, &config, &norm, &motion, past, network).unwrap();
    let mut frame = window.len();
    let mut obstacles = boxes_before(&motion, frame);
    for _ in 0..3 {
        let (frames, failure) = rollout.block().unwrap();
        assert_eq!((frames.len(), failure), (BLOCK, None));
        for found in frames {
            let expected = advance(&window, &mut obstacles, &motion, frame, scale);
            assert_eq!(found, expected, "frame {frame}");
            window.remove(0);
            window.push(found);
            frame += 1;
        }
    }
}

/// What a rollout gives before it fails, and why it does.
fn failing(
    motion: &Motion,
    window: &[Vec<[f64; 2]>],
    scale: f32,
) -> Option<(Frames, RolloutError)> {
    let device = gpu::for_tests()?;
    let config = stand_in_config(window.len());
    let network = StandIn::new(&device, &config, window[0].len(), scale);
    let norm = normalisation_for(&config);
    let past = Past { window, statics: &[], next: window.len() };
    let mut rollout = CudaRollout::new(&device, &config, &norm, motion, past, network).unwrap();
    let mut good = Vec::new();
    while good.len() < 100 {
        let (frames, failure) = rollout.block().unwrap();
        good.extend(frames);
        if let Some(failure) = failure {
            return Some((good, failure));
        }
    }
    panic!("no failure in 100 frames");
}

#[test]
fn failures_name_frame_and_point() {
    let mut window = start(50, 4, 1.0);
    let Some((good, failure)) = failing(&motion(), &window, f32::INFINITY) else { return };
    assert!(good.is_empty());
    assert_eq!(failure, RolloutError::NotFinite { frame: 4, point: 0 });

    // Free fall along x, in which this point reaches the wall with 0.35 m/frame in frame 26.
    for frame in &mut window {
        frame[7] = [0.12, 1.9];
    }
    let motion = Motion { fall: [0.015, 0.0], ..motion() };
    let Some((good, failure)) = failing(&motion, &window, 0.0) else { return };
    let mut frame = window.len();
    let mut obstacles = boxes_before(&motion, frame);
    for found in good {
        assert_eq!(found, advance(&window, &mut obstacles, &motion, frame, 0.0));
        window.remove(0);
        window.push(found);
        frame += 1;
    }
    let RolloutError::Left { frame: failed, point, distance } = failure else {
        panic!("{failure}")
    };
    assert_eq!(failed, frame);
    let (before, last) = (window[window.len() - 2][point], window[window.len() - 1][point]);
    let beyond = last[0] + (last[0] - before[0] + (1e-4 + 0.015)) - 4.0;
    assert!(beyond > 0.25 && (beyond - distance).abs() < 1e-12, "{beyond} {distance}");
}

/// Needs NVRTC, but no GPU.
#[test]
fn kernels_compile() {
    if !gpu::nvrtc_for_tests() {
        return;
    }
    for architecture in ["sm_80", "sm_90"] {
        for Source { name, text, defines } in [
            graph_source(),
            features_source(),
            integrate_source(),
            push_forward_source(),
            Source { name: "stand_in.cu", text: STAND_IN.to_owned(), defines: Vec::new() },
        ] {
            let cubin = compile(name, &text, architecture, &defines).unwrap();
            assert!(!cubin.is_empty(), "{name}");
        }
    }
}
