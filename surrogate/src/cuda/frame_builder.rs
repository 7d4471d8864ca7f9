//! Graphs and features of frames on the device. The CPU twin of the features is
//! [`window_input`](crate::features::window_input).

use std::ops::Range;
use std::sync::Arc;

use cudarc::driver::{CudaSlice, CudaView, PinnedHostSlice};
use gpu::{ConstPointer, Device, Error, Pointer};

use super::error::CudaError;
use super::graph_builder::{GraphBuilder, starts};
use super::ops::features::{
    FeatureFrames, FeatureKernels, Frame, Frames, Obstacle as DeviceObstacle, Obstacles, PAST,
    Scales, Standard, SurfaceStandard,
};
use super::ops::frame_input::FrameInput;
use super::ops::graph::FRAMES;
use super::support::supports;
use crate::features::{Normalisation, Obstacle, SKIN, standardised};
use crate::network::{ModelConfig, ModelKind, NodeFeature};

/// A frame that is to be made.
pub struct NewFrame<'a> {
    /// Positions in the frames up to this one, the last of them: as many as its features follow
    /// from.
    pub past: &'a [CudaView<'a, f32>],
    /// The newest of them, whose velocities a node knows: of a GNS all frames of the network; of a
    /// TGNNS the frame before and this one, or the first alone.
    pub known: usize,
    /// Frames from this one to the newest of its window.
    pub back: usize,
    /// Where graph and features go.
    pub frame: &'a mut FrameInput,
}

/// Makes what a network reads of frames: graph and features.
pub struct FrameBuilder {
    device: Arc<Device>,
    graph: GraphBuilder,
    kernels: FeatureKernels,
    config: ModelConfig,
    norm: Normalisation,
    scales: Scales,
    /// Frames that are made at once.
    frames: usize,
    /// Features beyond velocity and walls of each of them, points x columns.
    further: CudaSlice<f32>,
    /// Obstacles that the network sees, window after window,
    obstacles: CudaSlice<DeviceObstacle>,
    /// their number,
    obstacle_count: usize,
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
            walls_of_boxes: i32::from(config.obstacles),
            ..Scales::default()
        };
        for (k, walls) in bounds.iter().enumerate() {
            scales.velocity_mean[k] = norm.velocity_mean[k] as f32;
            scales.velocity_std[k] = norm.velocity_std[k] as f32;
            scales.bounds[k] = walls.map(|wall| wall as f32);
        }
        let frames = frames.clamp(1, FRAMES);
        let graph = GraphBuilder::new(device, radius, windows, frames)?;
        Ok(Self {
            further: device.zeros((frames * graph.points() * further).max(1))?,
            frames,
            obstacles: device.zeros(1)?,
            obstacle_count: 0,
            first_obstacle: device.zeros(windows.len() + 1)?,
            graph,
            kernels: FeatureKernels::load(device)?,
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

    /// See [`GraphBuilder::fits`].
    pub fn fits(&self, windows: &[usize]) -> bool {
        self.graph.fits(windows)
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

    /// Takes the obstacles of each window as they are at its newest frame; a network that
    /// [sees](ModelConfig::sees_boxes) none ignores them.
    ///
    /// # Errors
    /// The copy was refused, or too little memory.
    ///
    /// # Panics
    /// If there are more lists than windows.
    pub fn set_obstacles(&mut self, windows: &[Vec<Obstacle>]) -> Result<(), Error> {
        assert!(windows.len() < self.first_obstacle.len());
        if !self.config.sees_boxes() {
            return Ok(());
        }
        let first = starts(windows.iter().map(Vec::len));
        let all: Vec<_> = windows.iter().flatten().map(DeviceObstacle::from).collect();
        self.obstacle_count = all.len();
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

    /// Queues the step to the next frame, which is the newest of all windows from then on.
    ///
    /// # Errors
    /// A launch was refused.
    pub fn next_frame(&mut self) -> Result<(), Error> {
        if !self.config.sees_surfaces() || self.obstacle_count == 0 {
            return Ok(());
        }
        let obstacles = Pointer::to(&self.obstacles, self.device.stream());
        self.kernels.advance_obstacles(obstacles, self.obstacle_count)
    }

    /// Allocates a frame with at most `capacity` edges, the first of a window or a later one.
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
    fn some_features(&self, new: &[NewFrame]) -> Result<(), Error> {
        let (scales, points) = (self.scales, self.points());
        let all = FeatureFrames { scales, frames: self.frames(new), count: new.len(), points };
        let stream = self.device.stream();
        let obstacles = Obstacles {
            all: ConstPointer::to(&self.obstacles, stream),
            first: ConstPointer::to(&self.first_obstacle, stream),
            window: ConstPointer::to(self.graph.window(), stream),
        };
        self.moving_features(&all, obstacles)?;
        self.kernels.node_features(&all, obstacles)?;
        let capacity = new.iter().map(|new| new.frame.graph.capacity).max().unwrap_or(0);
        if capacity > 0 {
            self.kernels.edge_features(&all, capacity)?;
        }
        Ok(())
    }

    fn frames(&self, new: &[NewFrame]) -> Frames {
        let stream = self.device.stream();
        let further = self.points() * self.config.further_node_features();
        let mut frames = Frames::default();
        for (k, (frame, new)) in frames.of.iter_mut().zip(new).enumerate() {
            let graph = &new.frame.graph;
            *frame = Frame {
                known: new.known as i32,
                back: new.back as i32,
                edges: ConstPointer::to(&graph.edges, stream),
                receivers: ConstPointer::to(&graph.receiver, stream),
                senders: ConstPointer::to(&graph.sender, stream),
                further: Pointer::to(&self.further, stream).offset(k * further),
                node: Pointer::to(&new.frame.node, stream),
                edge: Pointer::to(&new.frame.edge, stream),
                ..Frame::default()
            };
            assert!(new.known <= new.past.len().min(PAST), "history of a frame");
            for (past, positions) in frame.past.iter_mut().zip(new.past.iter().rev()) {
                *past = ConstPointer::to(positions, stream);
            }
        }
        frames
    }

    /// Queues those further features that follow from positions.
    fn moving_features(&self, all: &FeatureFrames, obstacles: Obstacles) -> Result<(), Error> {
        let dimensions = self.config.dimensions;
        let mut column = 0;
        for feature in &self.config.node_features {
            let columns = column..column + feature.columns(dimensions);
            match feature {
                NodeFeature::Overburden => {
                    let Standard { mean, std } = self.standard(columns.clone());
                    let window = ConstPointer::to(self.graph.window(), self.device.stream());
                    self.kernels.overburden(all, window, [mean[0], std[0]], column)?;
                }
                NodeFeature::Acceleration => {
                    let frames = &all.frames.of[..all.count];
                    assert!(frames.iter().all(|frame| !frame.past[2].is_null()), "three frames");
                    let standard = self.standard(columns.clone());
                    self.kernels.acceleration(all, standard, column)?;
                }
                NodeFeature::Surfaces => {
                    let mut standard = SurfaceStandard::default();
                    for (k, column) in columns.clone().enumerate() {
                        standard.mean[k] = self.norm.features_mean[column] as f32;
                        standard.std[k] = self.norm.features_std[column] as f32;
                    }
                    self.kernels.surfaces(all, obstacles, standard, column)?;
                }
                NodeFeature::InitialStress
                | NodeFeature::InitialSolidFraction
                | NodeFeature::Material => {}
            }
            column = columns.end;
        }
        Ok(())
    }

    /// Mean and standard deviation of some columns of the further features.
    fn standard(&self, columns: Range<usize>) -> Standard {
        let mut standard = Standard::default();
        let (mean, std) =
            (&self.norm.features_mean[columns.clone()], &self.norm.features_std[columns]);
        for (k, (&mean, &std)) in mean.iter().zip(std).enumerate() {
            (standard.mean[k], standard.std[k]) = (mean as f32, std as f32);
        }
        standard
    }

    /// See [`GraphBuilder::count_windows`].
    ///
    /// # Errors
    /// The launch was refused.
    pub fn count_windows(&mut self, frame: &FrameInput) -> Result<(), Error> {
        self.graph.count_windows(&frame.graph)
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

impl From<&Obstacle> for DeviceObstacle {
    fn from(obstacle: &Obstacle) -> Self {
        let &Obstacle { corners, velocity, elapsed, friction } = obstacle;
        Self { corners, velocity, elapsed, friction }
    }
}
