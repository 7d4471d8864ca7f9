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
use super::graph::{FRAMES, GraphBuilder};
use super::launch::{address, each, of_frames};
use super::network::supports;
use crate::features::{Normalisation, Obstacle, SKIN, standardised};
use crate::network::{ModelConfig, ModelKind, NodeFeature};

/// The source of the kernels.
pub const FEATURES_SOURCE: &str = include_str!("features.cu");

/// Most frames of a history: more than the GNS has at most.
const PAST: usize = 16;

/// Numbers of an obstacle.
const OBSTACLE: usize = 4;

/// Threads of a warp.
const LANES: usize = 32;

/// Definitions that the source needs.
pub fn features_defines(dimensions: usize) -> Vec<String> {
    vec![format!("DIMENSIONS={dimensions}"), format!("FRAMES={FRAMES}"), format!("PAST={PAST}")]
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
    further: i32,
}

// SAFETY: plain numbers without padding, laid out as in `features.cu`.
unsafe impl DeviceRepr for Scales {}

/// `Frame` of `features.cu`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
struct FrameAddress {
    past: [CUdeviceptr; PAST],
    known: i32,
    edges: CUdeviceptr,
    receivers: CUdeviceptr,
    senders: CUdeviceptr,
    further: CUdeviceptr,
    node: CUdeviceptr,
    edge: CUdeviceptr,
}

/// `Frames` of `features.cu`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
struct FramesAddress([FrameAddress; FRAMES]);

// SAFETY: addresses and numbers, laid out as in `features.cu`.
unsafe impl DeviceRepr for FramesAddress {}

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

/// A frame that is to be made.
pub struct NewFrame<'a> {
    /// Positions in the frames up to this one, the last of them: as many as its features follow
    /// from.
    pub past: &'a [CudaView<'a, f32>],
    /// The newest of them, whose velocities a node knows: of a GNS all frames of the network; of a
    /// TGNNS the frame before and this one, or the first alone.
    pub known: usize,
    /// Where graph and features go.
    pub frame: &'a mut FrameInput,
}

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
    /// Frames that are made at once.
    frames: usize,
    /// Features beyond velocity and walls of each of them, points x columns.
    further: CudaSlice<f32>,
    /// Lower and upper corners of the obstacles that the network sees, window after window,
    obstacles: CudaSlice<f32>,
    /// and where those of each window begin and end.
    first_obstacle: CudaSlice<u32>,
}

impl FrameBuilder {
    /// For windows with these numbers of points, side by side, of which some `frames` are made at
    /// once. `bounds` are the lower and upper wall of each direction (m).
    ///
    /// # Errors
    /// A network that is too large for the kernels, too little memory, or no compiler.
    pub fn new(
        device: &Arc<Device>,
        config: &ModelConfig,
        norm: &Normalisation,
        bounds: &[[f64; 2]],
        windows: &[usize],
        frames: usize,
    ) -> Result<Self, CudaError> {
        supports(config)?;
        let d = config.dimensions;
        let radius = config.connection_radius as f32;
        let gns = i32::from(config.kind == ModelKind::Gns);
        let clamped = i32::from(config.clamps_walls());
        let further = config.further_node_features();
        let mut scales = Scales {
            radius,
            gns,
            clamped,
            skin: SKIN * radius,
            further: further as i32,
            ..Scales::default()
        };
        for (k, walls) in bounds.iter().enumerate() {
            scales.velocity_mean[k] = norm.velocity_mean[k] as f32;
            scales.velocity_std[k] = norm.velocity_std[k] as f32;
            scales.bounds[k] = walls.map(|wall| wall as f32);
        }
        let module = device.module("features.cu", FEATURES_SOURCE, &features_defines(d))?;
        let frames = frames.clamp(1, FRAMES);
        let graph = GraphBuilder::new(device, d, radius, windows, frames)?;
        Ok(Self {
            further: device.zeros((frames * graph.points() * further).max(1))?,
            frames,
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

    /// See [`GraphBuilder::window`].
    pub fn window(&self) -> &CudaSlice<u32> {
        self.graph.window()
    }

    /// See [`GraphBuilder::has_room_for`].
    pub fn has_room_for(&self, windows: &[usize]) -> bool {
        self.graph.has_room_for(windows)
    }

    /// See [`GraphBuilder::set_windows`].
    ///
    /// # Errors
    /// The copy was refused.
    pub fn set_windows(&mut self, windows: &[usize]) -> Result<(), Error> {
        self.graph.set_windows(windows)
    }

    /// Takes the features of points that never change, points x columns
    /// ([`static_features`](crate::features::static_features)).
    ///
    /// # Errors
    /// The copy was refused.
    ///
    /// # Panics
    /// If they are not those of all points.
    pub fn set_statics(&mut self, statics: &[f32]) -> Result<(), Error> {
        let features = &self.config.node_features;
        if !features.iter().any(|feature| feature.is_static()) {
            return Ok(());
        }
        let moving: Vec<_> = features
            .iter()
            .filter(|feature| !feature.is_static())
            .map(|feature| vec![0.0; self.points() * feature.columns(self.config.dimensions)])
            .collect();
        let values = standardised(features, &self.norm, self.points(), statics, &moving);
        if values.is_empty() {
            return Ok(());
        }
        (0..self.frames).try_for_each(|frame| {
            let mut to = self.further.slice_mut(frame * values.len()..(frame + 1) * values.len());
            Ok(self.device.stream().memcpy_htod(&values, &mut to)?)
        })
    }

    /// Takes the obstacles of each window, of which a network without `obstacles` sees none.
    ///
    /// # Errors
    /// The copy was refused, or too little memory.
    ///
    /// # Panics
    /// If there are more lists than windows.
    pub fn set_obstacles(&mut self, windows: &[Vec<Obstacle>]) -> Result<(), Error> {
        assert!(windows.len() < self.first_obstacle.len());
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
        stream.memcpy_htod(&first, &mut self.first_obstacle.slice_mut(..first.len()))?;
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
        let graph = self.graph.allocate(capacity)?;
        let (node, edge) = (graph.points * node, capacity * edge);
        self.device.reserve((node + edge) * size_of::<f32>())?;
        Ok(FrameInput {
            graph,
            node: self.device.zeros(node.max(1))?,
            edge: self.device.zeros(edge.max(1))?,
        })
    }

    /// Queues the building of the graphs of frames: see [`GraphBuilder::build`].
    ///
    /// # Errors
    /// A launch was refused.
    pub fn graphs(&mut self, frames: &mut [NewFrame]) -> Result<(), Error> {
        let mut graphs: Vec<_> = frames
            .iter_mut()
            .map(|new| (new.past[new.past.len() - 1].slice(..), &mut new.frame.graph))
            .collect();
        self.graph.build(&mut graphs)
    }

    /// Queues the computation of the features of frames whose graphs are built.
    ///
    /// # Errors
    /// A launch was refused.
    ///
    /// # Panics
    /// If there are fewer frames than the features follow from, or more than the kernels know.
    pub fn features(&mut self, frames: &mut [NewFrame]) -> Result<(), Error> {
        if self.points() == 0 {
            return Ok(());
        }
        frames.chunks(self.frames).try_for_each(|part| self.some_features(part))
    }

    /// Makes the features of as many frames as there is room for at once.
    fn some_features(&self, frames: &[NewFrame]) -> Result<(), Error> {
        let stream = self.device.stream();
        let points = self.points();
        let further = points * self.config.further_node_features() * size_of::<f32>();
        let mut at = FramesAddress::default();
        for (k, (at, new)) in at.0.iter_mut().zip(frames).enumerate() {
            let graph = &new.frame.graph;
            *at = FrameAddress {
                known: new.known as i32,
                edges: address(&graph.edges, stream),
                receivers: address(&graph.receiver, stream),
                senders: address(&graph.sender, stream),
                further: address(&self.further, stream) + (k * further) as u64,
                node: address(&new.frame.node, stream),
                edge: address(&new.frame.edge, stream),
                ..FrameAddress::default()
            };
            assert!(new.known <= new.past.len().min(PAST), "history of a frame");
            for (at, positions) in at.past.iter_mut().zip(new.past.iter().rev()) {
                *at = address(positions, stream);
            }
        }
        self.follow_motion(&at, frames.len())?;
        let (number, all) = (points as u32, |config| of_frames(config, frames.len()));
        let capacity = frames.iter().map(|new| new.frame.graph.capacity).max().unwrap_or(0);
        let obstacles = ObstaclesAddress {
            all: address(&self.obstacles, stream),
            first: address(&self.first_obstacle, stream),
            window: address(self.graph.window(), stream),
        };
        // SAFETY: the argument types are those of the kernels, and the arrays as long as they
        // expect: a later frame has more features than a first one.
        unsafe {
            let mut launch = stream.launch_builder(&self.nodes);
            launch.arg(&number).arg(&self.scales).arg(&at).arg(&obstacles);
            launch.launch(all(each(points)))?;
            if capacity > 0 {
                let mut launch = stream.launch_builder(&self.edges);
                launch.arg(&self.scales).arg(&at).launch(all(each(capacity)))?;
            }
        }
        Ok(())
    }

    /// Queues those further features that follow from positions.
    fn follow_motion(&self, at: &FramesAddress, frames: usize) -> Result<(), Error> {
        let stream = self.device.stream();
        let (points, scales) = (self.points() as u32, &self.scales);
        let all = |config| of_frames(config, frames);
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
                    launch.arg(&points).arg(scales).arg(at).arg(self.graph.window());
                    launch.arg(&mean).arg(&std).arg(&column);
                    // SAFETY: as above; the column is one of the further features'.
                    unsafe { launch.launch(all(each(LANES * points as usize)))? };
                }
                NodeFeature::Acceleration => {
                    let frames = &at.0[..frames];
                    assert!(frames.iter().all(|frame| frame.past[2] != 0), "three frames");
                    let mut launch = stream.launch_builder(&self.acceleration);
                    launch.arg(&points).arg(scales).arg(at).arg(&standard).arg(&column);
                    // SAFETY: as above; so are the columns.
                    unsafe { launch.launch(all(each(columns * points as usize)))? };
                }
                NodeFeature::InitialStress | NodeFeature::InitialSolidFraction => {}
            }
            place += columns;
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
