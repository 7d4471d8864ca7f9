//! Features of frames on the device. The kernels are `features.cu`, their CPU twin
//! [`window_input`](crate::features::window_input).

use std::sync::Arc;

use cudarc::driver::sys::CUdeviceptr;
use cudarc::driver::{CudaFunction, CudaView, DeviceRepr, PinnedHostSlice, PushKernelArg};
use gpu::{Device, Error};

use super::buffers::FrameInput;
use super::error::CudaError;
use super::graph::GraphBuilder;
use super::launch::{address, each};
use super::predict::supports;
use crate::config::ModelConfig;
use crate::features::Normalisation;

/// The source of the kernels.
pub const FEATURES_SOURCE: &str = include_str!("features.cu");

/// Definitions that the source needs.
pub fn features_defines(dimensions: usize) -> Vec<String> {
    vec![format!("DIMENSIONS={dimensions}")]
}

/// `Scales` of `features.cu`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
struct Scales {
    radius: f32,
    velocity_mean: [f32; 3],
    velocity_std: [f32; 3],
    bounds: [[f32; 2]; 3],
}

// SAFETY: plain numbers without padding, laid out as in `features.cu`.
unsafe impl DeviceRepr for Scales {}

/// Makes what a TGNNS reads of frames: graph and features.
pub struct FrameBuilder {
    device: Arc<Device>,
    graph: GraphBuilder,
    nodes: CudaFunction,
    edges: CudaFunction,
    config: ModelConfig,
    scales: Scales,
}

impl FrameBuilder {
    /// For windows with these numbers of points, side by side. `bounds` are the lower and upper wall
    /// of each direction (m).
    ///
    /// # Errors
    /// A network that reads other features, too little memory, or no compiler.
    pub fn new(
        device: &Arc<Device>,
        config: &ModelConfig,
        norm: &Normalisation,
        bounds: &[[f64; 2]],
        windows: &[usize],
    ) -> Result<Self, CudaError> {
        supports(config)?;
        let d = config.dimensions;
        let radius = config.connection_radius as f32;
        let mut scales = Scales { radius, ..Scales::default() };
        for (k, walls) in bounds.iter().enumerate() {
            scales.velocity_mean[k] = norm.velocity_mean[k] as f32;
            scales.velocity_std[k] = norm.velocity_std[k] as f32;
            scales.bounds[k] = walls.map(|wall| wall as f32);
        }
        let module = device.module("features.cu", FEATURES_SOURCE, &features_defines(d))?;
        Ok(Self {
            graph: GraphBuilder::new(device, d, radius, windows)?,
            nodes: module.load_function("node_features")?,
            edges: module.load_function("edge_features")?,
            config: config.clone(),
            scales,
            device: device.clone(),
        })
    }

    /// Points of all windows together.
    pub fn points(&self) -> usize {
        self.graph.points()
    }

    /// Room for a frame with at most `capacity` edges, the first of a window or a later one.
    ///
    /// # Errors
    /// Too little memory.
    pub fn allocate(&self, capacity: usize) -> Result<FrameInput, Error> {
        let node = self.points() * self.config.later_node_features();
        let edge = capacity * self.config.later_edge_features();
        self.device.reserve((node + edge) * size_of::<f32>())?;
        Ok(FrameInput {
            graph: self.graph.allocate(capacity)?,
            node: self.device.zeros(node.max(1))?,
            edge: self.device.zeros(edge.max(1))?,
        })
    }

    /// Queues the building of the graph of a frame: see [`GraphBuilder::build`].
    ///
    /// # Errors
    /// A launch was refused.
    pub fn graph(&mut self, now: &CudaView<f32>, frame: &mut FrameInput) -> Result<(), Error> {
        self.graph.build(now, &mut frame.graph)
    }

    /// Queues the computation of the features of a frame whose graph is built; `before` are the
    /// positions in the frame before, if it is not the first of its window.
    ///
    /// # Errors
    /// A launch was refused.
    pub fn features(
        &self,
        now: &CudaView<f32>,
        before: Option<&CudaView<f32>>,
        frame: &mut FrameInput,
    ) -> Result<(), Error> {
        let points = self.points();
        if points == 0 {
            return Ok(());
        }
        let stream = self.device.stream();
        let before: CUdeviceptr = before.map_or(0, |view| address(view, stream));
        let (number, graph) = (points as u32, &frame.graph);
        // SAFETY: the argument types are those of the kernels, and the arrays as long as they
        // expect: a later frame has more features than a first one.
        unsafe {
            let mut launch = stream.launch_builder(&self.nodes);
            launch.arg(&number).arg(&self.scales).arg(now).arg(&before);
            launch.arg(&frame.node).launch(each(points))?;
            if graph.capacity > 0 {
                let mut launch = stream.launch_builder(&self.edges);
                launch.arg(&graph.edges).arg(&graph.receiver).arg(&graph.sender);
                launch.arg(&self.scales).arg(now).arg(&before);
                launch.arg(&frame.edge).launch(each(graph.capacity))?;
            }
        }
        Ok(())
    }

    /// See [`GraphBuilder::copy_needed`].
    ///
    /// # Errors
    /// The copy was refused.
    pub fn copy_needed(&mut self, needed: &mut PinnedHostSlice<u64>) -> Result<(), Error> {
        self.graph.copy_needed(needed)
    }

    /// See [`GraphBuilder::needed`].
    ///
    /// # Errors
    /// A kernel failed.
    pub fn needed(&mut self) -> Result<usize, Error> {
        self.graph.needed()
    }
}
