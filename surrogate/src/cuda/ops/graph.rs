//! Kernels that build radius graphs. Their CPU twin is
//! [`radius_graph`](crate::features::radius_graph).

use std::sync::Arc;

use gpu::{
    ConstPointer, CudaName, Device, Error, Function, Kernel, Launch, Pointer, Source, checks,
    cuda_struct, definitions, files, kernel,
};

use super::geometry::{WARP, blocks, one_thread_each};
use crate::network::DIMENSIONS;

/// Receivers of a thread block, each served by a warp.
pub(in crate::cuda) const ROWS: u32 = 16;
/// Neighbours of a receiver that are kept from the count to the row, more than it has at usual
/// densities; those of a receiver with more are searched twice.
pub(in crate::cuda) const KEPT: usize = 64;
/// Most frames of a launch.
pub(in crate::cuda) const FRAMES: usize = 8;

/// Coordinates and the index of a point.
#[derive(Clone, Copy, Debug)]
pub(in crate::cuda) enum Float4 {}

impl CudaName for Float4 {
    const NAME: &'static str = "float4";
}

cuda_struct! {
    /// The cells that candidates are found in.
    pub(in crate::cuda) struct Grid {
        /// One over the width of a cell (1/m).
        pub inverse_width: f64,
        /// Square of the radius (m²).
        pub radius_squared: f32,
        /// A window has `side`² buckets; `side` is a power of two, at least 8, so that the
        /// cells around one have different buckets.
        pub side: u32,
        pub buckets: u32,
        /// Points of all windows together.
        pub points: u32,
    }

    /// The graph of a frame: [`DeviceGraph`](super::frame_input::DeviceGraph).
    #[derive(Default)]
    pub(in crate::cuda) struct Graph {
        pub start: Pointer<u32>,
        pub sender: Pointer<u32>,
        pub receiver: Pointer<u32>,
        pub reverse: Pointer<u32>,
        pub nodes: Pointer<u32>,
        pub edges: Pointer<u32>,
        /// Edges that there is room for.
        pub capacity: u32,
    }

    /// A frame: positions (points x 2, m) and the graph to build.
    #[derive(Default)]
    pub(in crate::cuda) struct Frame {
        pub position: ConstPointer<f32>,
        pub graph: Graph,
    }

    /// Frames of a launch.
    #[derive(Default)]
    pub(in crate::cuda) struct Frames {
        pub of: [Frame; FRAMES],
    }

    /// The cell lists of frames, one after the other.
    pub(in crate::cuda) struct Cells {
        /// Points in each bucket; one more entry counts those that have a place already.
        pub count: Pointer<u32>,
        /// First place of each bucket.
        pub first: Pointer<u32>,
        /// Bucket of each point,
        pub bucket: Pointer<u32>,
        /// and its number there.
        pub rank: Pointer<u32>,
        /// Coordinates of the point at each place, and its index as the bits of w.
        pub sorted: Pointer<Float4>,
        /// Number of neighbours of each receiver,
        pub neighbours: Pointer<u32>,
        /// and of all receivers of a thread block.
        pub block_neighbours: Pointer<u32>,
        /// The first [`KEPT`] neighbours of each receiver.
        pub kept: Pointer<u32>,
        /// Buckets of all windows.
        pub buckets: u32,
        /// Points that there is room for,
        pub points: u32,
        /// and thread blocks of their receivers.
        pub blocks: u32,
    }
}

kernel! {
    struct CountBuckets: count_buckets {
        grid: Grid,
        frames: Frames,
        /// Window of each point.
        window: ConstPointer<u32>,
        all: Cells,
    }

    struct PlaceBuckets: place_buckets {
        all: Cells,
    }

    struct SortPoints: sort_points {
        grid: Grid,
        frames: Frames,
        all: Cells,
    }

    struct CountEdges: count_edges {
        grid: Grid,
        frames: Frames,
        window: ConstPointer<u32>,
        all: Cells,
    }

    struct FillEdges: fill_edges {
        grid: Grid,
        frames: Frames,
        window: ConstPointer<u32>,
        all_cells: Cells,
        needed: Pointer<u64>,
    }

    struct ReverseEdges: reverse_edges {
        frames: Frames,
    }

    struct WindowEdges: window_edges {
        /// First edge of each point, and the number of edges.
        start: ConstPointer<u32>,
        first: ConstPointer<u32>,
        windows: u32,
        most: Pointer<u64>,
    }
}

/// The source of the kernels.
pub fn graph_source() -> Source {
    let definitions = definitions![Grid, Graph, Frame, Frames, Cells];
    let checks = checks![
        CountBuckets,
        PlaceBuckets,
        SortPoints,
        CountEdges,
        FillEdges,
        ReverseEdges,
        WindowEdges
    ];
    let text = [&definitions, files!["graph.cu"], &checks].concat();
    Source { name: "graph.cu", text, defines: Vec::new() }
        .define("DIMENSIONS", DIMENSIONS)
        .define("ROWS", ROWS as usize)
        .define("FRAMES", FRAMES)
        .define("KEPT", KEPT)
}

/// Some frames of the same points.
#[derive(Clone, Copy, Debug)]
pub(in crate::cuda) struct GraphFrames {
    pub grid: Grid,
    pub frames: Frames,
    /// Number of frames.
    pub count: usize,
    /// Window of each point.
    pub window: ConstPointer<u32>,
    pub cells: Cells,
}

/// The kernels; in this order they build graphs.
#[derive(Debug)]
pub(in crate::cuda) struct GraphKernels {
    device: Arc<Device>,
    count_buckets: Function<CountBuckets>,
    place_buckets: Function<PlaceBuckets>,
    sort_points: Function<SortPoints>,
    count_edges: Function<CountEdges>,
    fill_edges: Function<FillEdges>,
    reverse_edges: Function<ReverseEdges>,
    window_edges: Function<WindowEdges>,
}

impl GraphKernels {
    pub fn load(device: &Arc<Device>) -> Result<Self, Error> {
        let Source { name, text, defines } = graph_source();
        let module = &device.module(name, &text, &defines)?;
        Ok(Self {
            count_buckets: Function::load(device, module)?,
            place_buckets: Function::load(device, module)?,
            sort_points: Function::load(device, module)?,
            count_edges: Function::load(device, module)?,
            fill_edges: Function::load(device, module)?,
            reverse_edges: Function::load(device, module)?,
            window_edges: Function::load(device, module)?,
            device: device.clone(),
        })
    }

    /// Counts the points of each bucket.
    pub fn count_buckets(&self, all: &GraphFrames) -> Result<(), Error> {
        let &GraphFrames { grid, frames, count, window, cells } = all;
        let launch = one_thread_each(grid.points as usize, count);
        self.launch(&self.count_buckets, launch, &CountBuckets { grid, frames, window, all: cells })
    }

    /// Gives each bucket a stretch of places.
    pub fn place_buckets(&self, all: &GraphFrames) -> Result<(), Error> {
        let launch = one_thread_each(all.cells.buckets as usize, all.count);
        self.launch(&self.place_buckets, launch, &PlaceBuckets { all: all.cells })
    }

    /// Puts the points in their places.
    pub fn sort_points(&self, all: &GraphFrames) -> Result<(), Error> {
        let &GraphFrames { grid, frames, count, cells, .. } = all;
        let launch = one_thread_each(grid.points as usize, count);
        self.launch(&self.sort_points, launch, &SortPoints { grid, frames, all: cells })
    }

    /// Counts the neighbours of each receiver.
    pub fn count_edges(&self, all: &GraphFrames) -> Result<(), Error> {
        let &GraphFrames { grid, frames, window, cells, .. } = all;
        let arguments = CountEdges { grid, frames, window, all: cells };
        self.launch(&self.count_edges, receiver_blocks(all), &arguments)
    }

    /// Writes receivers and senders of all edges; `needed` becomes the most edges of a graph, if it
    /// was less.
    pub fn fill_edges(&self, all: &GraphFrames, needed: Pointer<u64>) -> Result<(), Error> {
        let &GraphFrames { grid, frames, window, cells, .. } = all;
        let arguments = FillEdges { grid, frames, window, all_cells: cells, needed };
        self.launch(&self.fill_edges, receiver_blocks(all), &arguments)
    }

    /// Finds the reverse of each of at most `capacity` edges, which is not 0.
    pub fn reverse_edges(&self, all: &GraphFrames, capacity: usize) -> Result<(), Error> {
        let launch = one_thread_each(capacity, all.count);
        self.launch(&self.reverse_edges, launch, &ReverseEdges { frames: all.frames })
    }

    /// Counts the edges of `windows` windows, whose first points are given, from the `start` of the points' rows;
    /// `most` become the most that they had.
    pub fn window_edges(
        &self,
        start: ConstPointer<u32>,
        first: ConstPointer<u32>,
        windows: usize,
        most: Pointer<u64>,
    ) -> Result<(), Error> {
        let arguments = WindowEdges { start, first, windows: windows as u32, most };
        self.launch(&self.window_edges, one_thread_each(windows, 1), &arguments)
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

/// Blocks with a warp for each receiver.
fn receiver_blocks(all: &GraphFrames) -> Launch {
    blocks([all.grid.points.div_ceil(ROWS) as usize, all.count], ROWS * WARP)
}
