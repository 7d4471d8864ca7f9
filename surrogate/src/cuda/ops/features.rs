//! Kernels that compute the features of nodes and edges. Their CPU twin is
//! [`window_input`](crate::features::window_input).

use std::sync::Arc;

use gpu::{
    ConstPointer, Device, Error, Function, Kernel, Launch, Pointer, Source, checks, cuda_struct,
    definitions, files, kernel,
};

use super::geometry::{WARP, one_thread_each};
use super::graph::FRAMES;
use crate::features::SURFACE_COLUMNS;
use crate::network::DIMENSIONS;

/// Most frames of a history: more than the GNS has at most.
pub(in crate::cuda) const PAST: usize = 16;

cuda_struct! {
    /// A rigid box: [`Obstacle`](crate::features::Obstacle).
    #[derive(Default)]
    pub(in crate::cuda) struct Obstacle {
        /// Lower and upper corner while it rests (m).
        pub corners: [[f64; 2]; 2],
        /// Velocity when it moves (m/frame).
        pub velocity: [f64; 2],
        /// Frames from its start to the newest frame of the window.
        pub elapsed: f64,
        /// Friction coefficients: left, right, bottom, top.
        pub friction: [f32; 4],
    }

    /// What features are scaled by.
    #[derive(Default)]
    pub(in crate::cuda) struct Scales {
        /// Connection radius (m).
        pub radius: f32,
        /// Mean and standard deviation of velocities (m/frame).
        pub velocity_mean: [f32; 3],
        pub velocity_std: [f32; 3],
        /// Lower and upper wall of each direction (m).
        pub bounds: [[f32; 2]; 3],
        /// 1: features of the GNS in place of those of the TGNNS.
        pub gns: i32,
        /// 1: distances to walls are clamped to one radius.
        pub clamped: i32,
        /// How far points may be inside an obstacle and still see its face (m).
        pub skin: f32,
        /// Features of a node beyond velocity and walls.
        pub further: i32,
        /// 1: faces of fixed boxes count as walls.
        pub walls_of_boxes: i32,
    }

    /// A frame to describe.
    #[derive(Default)]
    pub(in crate::cuda) struct Frame {
        /// Positions (points x 2, m) in the frame, in the one before it, and so on.
        pub past: [ConstPointer<f32>; PAST],
        /// The number of them whose velocities a node knows.
        pub known: i32,
        /// Frames from this one to the newest of its window.
        pub back: i32,
        /// Number of edges, and receiver and sender of each.
        pub edges: ConstPointer<u32>,
        pub receivers: ConstPointer<u32>,
        pub senders: ConstPointer<u32>,
        /// Features beyond velocity and walls (points x `Scales::further`).
        pub further: Pointer<f32>,
        /// Features of nodes and edges.
        pub node: Pointer<f32>,
        pub edge: Pointer<f32>,
    }

    /// Frames of a launch.
    #[derive(Default)]
    pub(in crate::cuda) struct Frames {
        pub of: [Frame; FRAMES],
    }

    /// Mean and standard deviation of a vector.
    #[derive(Default)]
    pub(in crate::cuda) struct Standard {
        pub mean: [f32; 3],
        pub std: [f32; 3],
    }

    /// The same of the features of surfaces.
    #[derive(Default)]
    pub(in crate::cuda) struct SurfaceStandard {
        pub mean: [f32; SURFACE_COLUMNS],
        pub std: [f32; SURFACE_COLUMNS],
    }

    /// The obstacles of each window: those from `first[window]` to `first[window + 1]`.
    pub(in crate::cuda) struct Obstacles {
        pub all: ConstPointer<Obstacle>,
        pub first: ConstPointer<u32>,
        /// Window of each point.
        pub window: ConstPointer<u32>,
    }
}

kernel! {
    struct NodeFeatures: node_features {
        points: u32,
        scales: Scales,
        frames: Frames,
        obstacles: Obstacles,
    }

    struct EdgeFeatures: edge_features {
        scales: Scales,
        frames: Frames,
    }

    struct Overburden: overburden {
        points: u32,
        scales: Scales,
        frames: Frames,
        /// Window of each point.
        window: ConstPointer<u32>,
        mean: f32,
        std: f32,
        /// Column of the further features.
        column: i32,
    }

    struct Acceleration: acceleration {
        points: u32,
        scales: Scales,
        frames: Frames,
        standard: Standard,
        /// First column of the further features.
        column: i32,
    }

    struct Surfaces: surfaces {
        points: u32,
        scales: Scales,
        frames: Frames,
        obstacles: Obstacles,
        standard: SurfaceStandard,
        /// First column of the further features.
        column: i32,
    }

    struct AdvanceObstacles: advance_obstacles {
        count: u32,
        obstacles: Pointer<Obstacle>,
    }
}

/// The source of the kernels.
pub fn features_source() -> Source {
    let definitions =
        definitions![Scales, Frame, Frames, Standard, SurfaceStandard, Obstacle, Obstacles];
    let checks =
        checks![NodeFeatures, EdgeFeatures, Overburden, Acceleration, Surfaces, AdvanceObstacles];
    let text = [&definitions, files!["features.cu"], &checks].concat();
    Source { name: "features.cu", text, defines: Vec::new() }
        .define("DIMENSIONS", DIMENSIONS)
        .define("SURFACE_COLUMNS", SURFACE_COLUMNS)
}

/// Some frames of the same points.
#[derive(Clone, Copy, Debug)]
pub(in crate::cuda) struct FeatureFrames {
    pub scales: Scales,
    pub frames: Frames,
    /// Number of frames, and points of each.
    pub count: usize,
    pub points: usize,
}

/// The kernels.
#[derive(Debug)]
pub(in crate::cuda) struct FeatureKernels {
    device: Arc<Device>,
    node_features: Function<NodeFeatures>,
    edge_features: Function<EdgeFeatures>,
    overburden: Function<Overburden>,
    acceleration: Function<Acceleration>,
    surfaces: Function<Surfaces>,
    advance_obstacles: Function<AdvanceObstacles>,
}

impl FeatureKernels {
    pub fn load(device: &Arc<Device>) -> Result<Self, Error> {
        let Source { name, text, defines } = features_source();
        let module = &device.module(name, &text, &defines)?;
        Ok(Self {
            node_features: Function::load(device, module)?,
            edge_features: Function::load(device, module)?,
            overburden: Function::load(device, module)?,
            acceleration: Function::load(device, module)?,
            surfaces: Function::load(device, module)?,
            advance_obstacles: Function::load(device, module)?,
            device: device.clone(),
        })
    }

    /// Velocities, distances to walls and obstacles, then the further features, which must be there.
    pub fn node_features(&self, all: &FeatureFrames, obstacles: Obstacles) -> Result<(), Error> {
        let &FeatureFrames { scales, frames, count, points } = all;
        let launch = one_thread_each(points, count);
        let arguments = NodeFeatures { points: points as u32, scales, frames, obstacles };
        self.launch(&self.node_features, launch, &arguments)
    }

    /// Features of at most `capacity` edges, which is not 0.
    pub fn edge_features(&self, all: &FeatureFrames, capacity: usize) -> Result<(), Error> {
        let &FeatureFrames { scales, frames, count, .. } = all;
        let launch = one_thread_each(capacity, count);
        self.launch(&self.edge_features, launch, &EdgeFeatures { scales, frames })
    }

    /// Points above each point, standardised with `mean` and `std`, into `column` of the further
    /// features; `window` is that of each point.
    pub fn overburden(
        &self,
        all: &FeatureFrames,
        window: ConstPointer<u32>,
        [mean, std]: [f32; 2],
        column: usize,
    ) -> Result<(), Error> {
        let &FeatureFrames { scales, frames, count, points } = all;
        let launch = one_thread_each(WARP as usize * points, count);
        let (points, column) = (points as u32, column as i32);
        let arguments = Overburden { points, scales, frames, window, mean, std, column };
        self.launch(&self.overburden, launch, &arguments)
    }

    /// Accelerations of points, standardised, into the further features from `column` on.
    pub fn acceleration(
        &self,
        all: &FeatureFrames,
        standard: Standard,
        column: usize,
    ) -> Result<(), Error> {
        let &FeatureFrames { scales, frames, count, points } = all;
        let launch = one_thread_each(DIMENSIONS * points, count);
        let (points, column) = (points as u32, column as i32);
        let arguments = Acceleration { points, scales, frames, standard, column };
        self.launch(&self.acceleration, launch, &arguments)
    }

    /// Surfaces of boxes near each point, standardised, into the further features from `column` on.
    pub fn surfaces(
        &self,
        all: &FeatureFrames,
        obstacles: Obstacles,
        standard: SurfaceStandard,
        column: usize,
    ) -> Result<(), Error> {
        let &FeatureFrames { scales, frames, count, points } = all;
        let launch = one_thread_each(points, count);
        let (points, column) = (points as u32, column as i32);
        let arguments = Surfaces { points, scales, frames, obstacles, standard, column };
        self.launch(&self.surfaces, launch, &arguments)
    }

    /// Makes the next frame the newest of the windows of `count` obstacles, at least one.
    pub fn advance_obstacles(
        &self,
        obstacles: Pointer<Obstacle>,
        count: usize,
    ) -> Result<(), Error> {
        let arguments = AdvanceObstacles { count: count as u32, obstacles };
        self.launch(&self.advance_obstacles, one_thread_each(count, 1), &arguments)
    }

    fn launch<K: Kernel>(
        &self,
        kernel: &Function<K>,
        launch: Launch,
        arguments: &K,
    ) -> Result<(), Error> {
        // SAFETY: the pointers are to live buffers of these sizes.
        unsafe { kernel.launch(self.device.stream(), launch, arguments) }
    }
}
