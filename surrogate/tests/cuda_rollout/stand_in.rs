//! A kernel in place of a network, whose sums are the same on the processor.

use std::sync::Arc;

use burn::backend::Flex;
use cudarc::driver::{CudaFunction, CudaSlice, LaunchConfig, PushKernelArg};
use gpu::Device;
use surrogate::cuda::{CudaError, FrameInput, Motion, Network};
use surrogate::features::{Obstacle, Window, radius_graph, window_input};
use surrogate::network::{ModelConfig, NodeFeature};

use crate::fixtures::{RADIUS, normalisation, normalisation_for, rows};
use crate::scene::{integrate, single};

/// Accelerations that depend on all that a network reads, in sums of fixed order.
pub const STAND_IN: &str = r#"
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
pub fn stand_in(windows: &[Window], config: &ModelConfig, scale: f32) -> Vec<f32> {
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
pub struct StandIn {
    device: Arc<Device>,
    kernel: CudaFunction,
    /// Features of a node.
    columns: u32,
    scale: f32,
    output: CudaSlice<f32>,
    calls: usize,
}

impl StandIn {
    pub fn new(device: &Arc<Device>, config: &ModelConfig, points: usize, scale: f32) -> Self {
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

/// A network that the stand-in takes the place of: it sees all boxes.
pub fn stand_in_config(frames: usize) -> ModelConfig {
    let node_features = vec![NodeFeature::Surfaces];
    ModelConfig { frames, obstacles: true, node_features, ..ModelConfig::default() }
}

/// One frame of the rollout as `Rollout::advance` makes it, with the stand-in.
pub fn advance(
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
