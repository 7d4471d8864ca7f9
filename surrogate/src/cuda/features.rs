//! Features of frames on the device. The kernels are `features.cu`, their CPU twin
//! [`window_input`](crate::features::window_input).

use std::sync::Arc;

use cudarc::driver::sys::CUdeviceptr;
use cudarc::driver::{
    CudaFunction, CudaSlice, CudaView, DeviceRepr, PinnedHostSlice, PushKernelArg,
};
use gpu::{Device, Error};

use super::buffers::FrameInput;
use super::error::CudaError;
use super::graph::GraphBuilder;
use super::launch::{address, each};
use super::network::supports;
use crate::config::{ModelConfig, ModelKind};
use crate::features::{Normalisation, Obstacle, SKIN};
use crate::node_features::{self, NodeFeature};

/// The source of the kernels.
pub const FEATURES_SOURCE: &str = include_str!("features.cu");

/// Most frames whose velocities a node knows: more than the GNS has at most.
const FRAMES: usize = 16;

/// Numbers of an obstacle.
const OBSTACLE: usize = 4;

/// Threads of a warp.
const LANES: usize = 32;

/// Definitions that the source needs.
pub fn features_defines(dimensions: usize) -> Vec<String> {
    vec![format!("DIMENSIONS={dimensions}"), format!("FRAMES={FRAMES}")]
}

/// `Scales` of `features.cu`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
struct Scales {
    radius: f32,
    velocity_mean: [f32; 3],
    velocity_std: [f32; 3],
    bounds: [[f32; 2]; 3],
    gns: i32,
    clamped: i32,
    skin: f32,
}

// SAFETY: plain numbers without padding, laid out as in `features.cu`.
unsafe impl DeviceRepr for Scales {}

/// `History` of `features.cu`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
struct History {
    at: [CUdeviceptr; FRAMES],
    count: i32,
}

// SAFETY: addresses and a number, laid out as in `features.cu`.
unsafe impl DeviceRepr for History {}

/// `Standard` of `features.cu`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
struct Standard {
    mean: [f32; 3],
    std: [f32; 3],
}

// SAFETY: plain numbers, laid out as in `features.cu`.
unsafe impl DeviceRepr for Standard {}

/// `Obstacles` of `features.cu`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
struct ObstaclesAddress {
    all: CUdeviceptr,
    first: CUdeviceptr,
    window: CUdeviceptr,
}

// SAFETY: addresses, laid out as in `features.cu`.
unsafe impl DeviceRepr for ObstaclesAddress {}

/// `Further` of `features.cu`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
struct FurtherAddress {
    values: CUdeviceptr,
    columns: i32,
}

// SAFETY: an address and a number, laid out as in `features.cu`.
unsafe impl DeviceRepr for FurtherAddress {}

/// Makes what a network reads of frames: graph and features.
pub struct FrameBuilder {
    device: Arc<Device>,
    graph: GraphBuilder,
    nodes: CudaFunction,
    edges: CudaFunction,
    overburden: CudaFunction,
    acceleration: CudaFunction,
    config: ModelConfig,
    norm: Normalisation,
    scales: Scales,
    /// Features beyond velocity and walls, points x columns, of the frame that is made.
    further: CudaSlice<f32>,
    /// Lower and upper corners of the obstacles that the network sees, window after window,
    obstacles: CudaSlice<f32>,
    /// and where those of each window begin and end.
    first_obstacle: CudaSlice<u32>,
}

impl FrameBuilder {
    /// For windows with these numbers of points, side by side. `bounds` are the lower and upper wall
    /// of each direction (m).
    ///
    /// # Errors
    /// A network that is too large for the kernels, too little memory, or no compiler.
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
        let gns = i32::from(config.kind == ModelKind::Gns);
        let clamped = i32::from(config.clamps_walls());
        let mut scales = Scales { radius, gns, clamped, skin: SKIN * radius, ..Scales::default() };
        for (k, walls) in bounds.iter().enumerate() {
            scales.velocity_mean[k] = norm.velocity_mean[k] as f32;
            scales.velocity_std[k] = norm.velocity_std[k] as f32;
            scales.bounds[k] = walls.map(|wall| wall as f32);
        }
        let module = device.module("features.cu", FEATURES_SOURCE, &features_defines(d))?;
        let graph = GraphBuilder::new(device, d, radius, windows)?;
        let further = graph.points() * config.further_node_features();
        Ok(Self {
            further: device.zeros(further.max(1))?,
            obstacles: device.zeros(OBSTACLE)?,
            first_obstacle: device.zeros(windows.len() + 1)?,
            graph,
            nodes: module.load_function("node_features")?,
            edges: module.load_function("edge_features")?,
            overburden: module.load_function("overburden")?,
            acceleration: module.load_function("acceleration")?,
            config: config.clone(),
            norm: norm.clone(),
            scales,
            device: device.clone(),
        })
    }

    /// Points of all windows together.
    pub fn points(&self) -> usize {
        self.graph.points()
    }

    /// Takes the features of points that never change, points x columns
    /// ([`node_features::static_features`]).
    ///
    /// # Errors
    /// The copy was refused.
    ///
    /// # Panics
    /// If they are not those of all points.
    pub fn set_statics(&mut self, statics: &[f32]) -> Result<(), Error> {
        let features = &self.config.node_features;
        let moving: Vec<_> = features
            .iter()
            .filter(|feature| !feature.is_static())
            .map(|feature| vec![0.0; self.points() * feature.columns(self.config.dimensions)])
            .collect();
        let values =
            node_features::standardised(features, &self.norm, self.points(), statics, &moving);
        if !values.is_empty() {
            self.device.stream().memcpy_htod(&values, &mut self.further)?;
        }
        Ok(())
    }

    /// Takes the obstacles of each window, of which a network without `obstacles` sees none.
    ///
    /// # Errors
    /// The copy was refused, or too little memory.
    ///
    /// # Panics
    /// If there are not as many lists as windows.
    pub fn set_obstacles(&mut self, windows: &[Vec<Obstacle>]) -> Result<(), Error> {
        assert_eq!(windows.len() + 1, self.first_obstacle.len());
        if !self.config.obstacles {
            return Ok(());
        }
        let mut first = vec![0];
        first.extend(windows.iter().scan(0, |sum, window| {
            *sum += window.len() as u32;
            Some(*sum)
        }));
        let all: Vec<f32> = windows.iter().flatten().flatten().flatten().copied().collect();
        if all.len() > self.obstacles.len() {
            self.obstacles = self.device.zeros(all.len())?;
        }
        let stream = self.device.stream();
        stream.memcpy_htod(&first, &mut self.first_obstacle)?;
        if !all.is_empty() {
            stream.memcpy_htod(&all, &mut self.obstacles)?;
        }
        Ok(())
    }

    /// Room for a frame with at most `capacity` edges, the first of a window or a later one.
    ///
    /// # Errors
    /// Too little memory.
    pub fn allocate(&self, capacity: usize) -> Result<FrameInput, Error> {
        let config = &self.config;
        let [node, edge] = match config.kind {
            ModelKind::Tgnns => [config.later_node_features(), config.later_edge_features()],
            ModelKind::Gns => [config.gns_node_features(), config.first_edge_features()],
        };
        let (node, edge) = (self.points() * node, capacity * edge);
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

    /// Queues the computation of the features of a frame whose graph is built. `past` are the
    /// positions in the frames up to this one, the last of them. A node knows the velocities in the
    /// `known` newest of them: of a GNS all frames of the network; of a TGNNS the frame before and
    /// this one, or the first alone.
    ///
    /// # Errors
    /// A launch was refused.
    ///
    /// # Panics
    /// If there is no frame, fewer than the features follow from, or more than the kernels know.
    pub fn features(
        &mut self,
        past: &[CudaView<f32>],
        known: usize,
        frame: &mut FrameInput,
    ) -> Result<(), Error> {
        let points = self.points();
        if points == 0 {
            return Ok(());
        }
        let stream = self.device.stream();
        let history = &past[past.len() - known..];
        let mut at = History { count: history.len() as i32, ..History::default() };
        for (at, positions) in at.at[..history.len()].iter_mut().zip(history) {
            *at = address(positions, stream);
        }
        let now = at.at[history.len() - 1];
        let moving = self.config.kind == ModelKind::Tgnns && history.len() > 1;
        let before = if moving { at.at[history.len() - 2] } else { 0 };
        self.follow_motion(past)?;
        let (number, graph) = (points as u32, &frame.graph);
        let obstacles = ObstaclesAddress {
            all: address(&self.obstacles, stream),
            first: address(&self.first_obstacle, stream),
            window: address(self.graph.window(), stream),
        };
        let further = self.further_address();
        // SAFETY: the argument types are those of the kernels, and the arrays as long as they
        // expect: a later frame has more features than a first one.
        unsafe {
            let mut launch = stream.launch_builder(&self.nodes);
            launch.arg(&number).arg(&self.scales).arg(&at).arg(&obstacles).arg(&further);
            launch.arg(&frame.node).launch(each(points))?;
            if graph.capacity > 0 {
                let mut launch = stream.launch_builder(&self.edges);
                launch.arg(&graph.edges).arg(&graph.receiver).arg(&graph.sender);
                launch.arg(&self.scales).arg(&now).arg(&before);
                launch.arg(&frame.edge).launch(each(graph.capacity))?;
            }
        }
        Ok(())
    }

    /// Queues those further features that follow from positions.
    fn follow_motion(&self, past: &[CudaView<f32>]) -> Result<(), Error> {
        let stream = self.device.stream();
        let (points, further) = (self.points() as u32, self.further_address());
        let now = address(&past[past.len() - 1], stream);
        let mut place = 0;
        for feature in &self.config.node_features {
            let columns = feature.columns(self.config.dimensions);
            let mut standard = Standard::default();
            let these = place..place + columns;
            for (k, (&mean, &std)) in self.norm.features_mean[these.clone()]
                .iter()
                .zip(&self.norm.features_std[these])
                .enumerate()
            {
                (standard.mean[k], standard.std[k]) = (mean as f32, std as f32);
            }
            let column = place as i32;
            match feature {
                NodeFeature::Overburden => {
                    let [mean, std] = [standard.mean[0], standard.std[0]];
                    let mut launch = stream.launch_builder(&self.overburden);
                    launch.arg(&points).arg(self.graph.window()).arg(&self.scales.radius);
                    launch.arg(&now).arg(&mean).arg(&std).arg(&further).arg(&column);
                    // SAFETY: as above; the column is one of the further features'.
                    unsafe { launch.launch(each(LANES * points as usize))? };
                }
                NodeFeature::Acceleration => {
                    let [oldest, before] =
                        [3, 2].map(|back| address(&past[past.len() - back], stream));
                    let mut launch = stream.launch_builder(&self.acceleration);
                    launch.arg(&points).arg(&oldest).arg(&before).arg(&now);
                    launch.arg(&standard).arg(&further).arg(&column);
                    // SAFETY: as above; so are the columns.
                    unsafe { launch.launch(each(columns * points as usize))? };
                }
                NodeFeature::InitialStress | NodeFeature::InitialSolidFraction => {}
            }
            place += columns;
        }
        Ok(())
    }

    fn further_address(&self) -> FurtherAddress {
        FurtherAddress {
            values: address(&self.further, self.device.stream()),
            columns: self.config.further_node_features() as i32,
        }
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
