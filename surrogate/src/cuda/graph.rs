//! Radius graphs on the device. The kernels are `graph.cu`, their CPU twin
//! [`radius_graph`](crate::features::radius_graph).

use std::sync::Arc;

use cudarc::driver::{
    CudaFunction, CudaSlice, CudaView, DeviceRepr, PinnedHostSlice, PushKernelArg, sys,
};
use gpu::{Device, Error};

use super::buffers::DeviceGraph;
use super::launch::{address, blocks, each, of_frames};

/// The source of the kernels.
pub const GRAPH_SOURCE: &str = include_str!("graph.cu");

/// Receivers of a thread block: a warp each.
const ROWS: u32 = 16;
const LANES: u32 = 32;
/// Neighbours of a receiver that are kept, more than it has at usual densities; those of a receiver with
/// more are searched twice.
const KEPT: usize = 64;

/// Most frames of a launch.
pub(super) const FRAMES: usize = 8;

/// Definitions that the source needs.
pub fn graph_defines(dimensions: usize) -> Vec<String> {
    vec![
        format!("DIMENSIONS={dimensions}"),
        format!("ROWS={ROWS}"),
        format!("FRAMES={FRAMES}"),
        format!("KEPT={KEPT}"),
    ]
}

/// `Grid` of `graph.cu`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
struct Grid {
    inverse_width: f64,
    radius_squared: f32,
    side: u32,
    buckets: u32,
    points: u32,
}

// SAFETY: plain numbers, laid out as in `graph.cu`.
unsafe impl DeviceRepr for Grid {}

impl Grid {
    /// A grid with at least two buckets for each point of a window.
    fn new(dimensions: usize, radius: f32, points: usize, largest_window: usize) -> Self {
        let mut side: u32 = 8;
        while (side as usize).pow(dimensions as u32) < 2 * largest_window {
            side *= 2;
        }
        Self {
            // Wider than the radius by more than the rounding of a cell's number.
            inverse_width: 1.0 / (1.001 * f64::from(radius)),
            radius_squared: radius * radius,
            side,
            buckets: side.pow(dimensions as u32),
            points: points as u32,
        }
    }
}

/// `Cells` of `graph.cu`.
#[repr(C)]
#[derive(Clone, Copy)]
struct CellsAddress {
    arrays: [sys::CUdeviceptr; 8],
    buckets: u32,
    points: u32,
    blocks: u32,
}

// SAFETY: device addresses and numbers, in the order of `graph.cu`.
unsafe impl DeviceRepr for CellsAddress {}

/// `Frames` of `graph.cu`: positions, graph and its capacity.
#[repr(C)]
#[derive(Clone, Copy, Default)]
struct FrameAddress {
    arrays: [sys::CUdeviceptr; 7],
    capacity: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Default)]
struct FramesAddress([FrameAddress; FRAMES]);

// SAFETY: device addresses and numbers, in the order of `graph.cu`.
unsafe impl DeviceRepr for FramesAddress {}

/// Builds the radius graphs of frames of the same points.
///
/// Launches do not depend on the number of edges, and nothing is read back, so they can be captured
/// in a CUDA graph. Whether all edges found room is asked for afterwards, with
/// [`needed`](Self::needed).
pub struct GraphBuilder {
    device: Arc<Device>,
    kernels: Kernels,
    dimensions: usize,
    grid: Grid,
    windows: Vec<usize>,
    work: Work,
    /// `[1]` Most edges that a graph had.
    needed: CudaSlice<u64>,
}

struct Kernels {
    count_buckets: CudaFunction,
    place_buckets: CudaFunction,
    sort_points: CudaFunction,
    count_edges: CudaFunction,
    fill_edges: CudaFunction,
    reverse_edges: CudaFunction,
}

/// Arrays of `graph.cu` besides the graph.
struct Work {
    /// Frames, windows and points of all windows together that there is room for.
    frames: usize,
    windows: usize,
    points: usize,
    /// Window of each point.
    window: CudaSlice<u32>,
    count: CudaSlice<u32>,
    first: CudaSlice<u32>,
    bucket: CudaSlice<u32>,
    rank: CudaSlice<u32>,
    sorted: CudaSlice<f32>,
    neighbours: CudaSlice<u32>,
    block_neighbours: CudaSlice<u32>,
    kept: CudaSlice<u32>,
}

impl Work {
    fn new(
        device: &Device,
        windows: usize,
        points: usize,
        frames: usize,
        grid: &Grid,
    ) -> Result<Self, Error> {
        let buckets = windows * grid.buckets as usize;
        // An empty allocation is an error.
        let points = points.max(1);
        let frames = frames.clamp(1, FRAMES);
        Ok(Self {
            frames,
            windows,
            points,
            window: device.zeros(points)?,
            count: device.zeros(frames * (buckets + 1))?,
            first: device.zeros(frames * buckets.max(1))?,
            bucket: device.zeros(frames * points)?,
            rank: device.zeros(frames * points)?,
            sorted: device.zeros(frames * 4 * points)?,
            neighbours: device.zeros(frames * points)?,
            block_neighbours: device.zeros(frames * points.div_ceil(ROWS as usize))?,
            kept: device.zeros(frames * points * KEPT)?,
        })
    }
}

impl GraphBuilder {
    /// For points in 2 or 3 dimensions, of which those closer than `radius` (m) are neighbours;
    /// `windows` are the numbers of points of windows side by side, `frames` those made at once.
    ///
    /// # Errors
    /// Too little memory, or no compiler.
    pub fn new(
        device: &Arc<Device>,
        dimensions: usize,
        radius: f32,
        windows: &[usize],
        frames: usize,
    ) -> Result<Self, Error> {
        let module = device.module("graph.cu", GRAPH_SOURCE, &graph_defines(dimensions))?;
        let kernels = Kernels {
            count_buckets: module.load_function("count_buckets")?,
            place_buckets: module.load_function("place_buckets")?,
            sort_points: module.load_function("sort_points")?,
            count_edges: module.load_function("count_edges")?,
            fill_edges: module.load_function("fill_edges")?,
            reverse_edges: module.load_function("reverse_edges")?,
        };
        let (points, largest) = (windows.iter().sum(), windows.iter().copied().max().unwrap_or(0));
        let grid = Grid::new(dimensions, radius, points, largest);
        let mut builder = Self {
            kernels,
            dimensions,
            windows: Vec::new(),
            work: Work::new(device, windows.len(), points, frames, &grid)?,
            grid,
            needed: device.zeros(1)?,
            device: device.clone(),
        };
        builder.set_windows(windows)?;
        Ok(builder)
    }

    /// Whether there is room for windows with these numbers of points.
    pub fn has_room_for(&self, windows: &[usize]) -> bool {
        windows.len() <= self.work.windows && windows.iter().sum::<usize>() <= self.work.points
    }

    /// Takes other windows, for which there is [room](Self::has_room_for).
    ///
    /// # Errors
    /// The copy was refused.
    ///
    /// # Panics
    /// If there is no room for them.
    pub fn set_windows(&mut self, windows: &[usize]) -> Result<(), Error> {
        if self.windows == windows {
            return Ok(());
        }
        assert!(self.has_room_for(windows), "room for {windows:?}");
        let numbered = windows.iter().enumerate();
        let window: Vec<u32> =
            numbered.flat_map(|(k, &n)| std::iter::repeat_n(k as u32, n)).collect();
        if !window.is_empty() {
            self.device.stream().memcpy_htod(&window, &mut self.work.window)?;
        }
        self.grid.points = window.len() as u32;
        self.windows = windows.to_vec();
        Ok(())
    }

    /// Points of all windows together.
    pub fn points(&self) -> usize {
        self.grid.points as usize
    }

    /// Number of the window of each point, where there are points.
    pub fn window(&self) -> &CudaSlice<u32> {
        &self.work.window
    }

    /// Room for a graph of as many points as there is room for and at most `capacity` edges.
    ///
    /// # Errors
    /// Too little memory.
    pub fn allocate(&self, capacity: usize) -> Result<DeviceGraph, Error> {
        let room = capacity.max(1);
        self.device.reserve(3 * room * size_of::<u32>())?;
        let points = self.work.points;
        Ok(DeviceGraph {
            points,
            capacity,
            start: self.device.zeros(points + 1)?,
            sender: self.device.zeros(room)?,
            receiver: self.device.zeros(room)?,
            reverse: self.device.zeros(room)?,
            nodes: self.device.zeros(1)?,
            edges: self.device.zeros(1)?,
        })
    }

    /// Queues the building of the graphs of frames whose positions, points x dimensions (m), are
    /// given. A graph with more edges than there is room for is left without any.
    ///
    /// # Errors
    /// A launch was refused.
    pub fn build(&mut self, frames: &mut [(CudaView<f32>, &mut DeviceGraph)]) -> Result<(), Error> {
        if self.points() == 0 {
            return Ok(());
        }
        frames.chunks(self.work.frames).try_for_each(|part| self.build_some(part))
    }

    /// Builds as many graphs as there is room for at once.
    fn build_some(&mut self, frames: &[(CudaView<f32>, &mut DeviceGraph)]) -> Result<(), Error> {
        let stream = self.device.stream();
        let work = &mut self.work;
        stream.memset_zeros(&mut work.count)?;
        let (points, windows) = (self.grid.points as usize, work.windows as u32);
        let cells = CellsAddress {
            arrays: [
                address(&work.count, stream),
                address(&work.first, stream),
                address(&work.bucket, stream),
                address(&work.rank, stream),
                address(&work.sorted, stream),
                address(&work.neighbours, stream),
                address(&work.block_neighbours, stream),
                address(&work.kept, stream),
            ],
            buckets: windows * self.grid.buckets,
            points: work.points as u32,
            blocks: (work.points as u32).div_ceil(ROWS),
        };
        let mut at = FramesAddress::default();
        for (at, (position, graph)) in at.0.iter_mut().zip(frames) {
            debug_assert_eq!(position.len(), points * self.dimensions);
            *at = FrameAddress {
                arrays: [
                    address(position, stream),
                    address(&graph.start, stream),
                    address(&graph.sender, stream),
                    address(&graph.receiver, stream),
                    address(&graph.reverse, stream),
                    address(&graph.nodes, stream),
                    address(&graph.edges, stream),
                ],
                capacity: graph.capacity as u32,
            };
        }
        let (grid, window, kernels) = (&self.grid, &work.window, &self.kernels);
        let all = |config| of_frames(config, frames.len());
        let rows = all(blocks(grid.points.div_ceil(ROWS), ROWS * LANES));
        let capacity = frames.iter().map(|(_, graph)| graph.capacity).max().unwrap_or(0);
        // SAFETY: the argument types are laid out as those of the kernels, the arrays as long as
        // they expect.
        unsafe {
            let mut launch = stream.launch_builder(&kernels.count_buckets);
            launch.arg(grid).arg(&at).arg(window).arg(&cells).launch(all(each(points)))?;
            let mut launch = stream.launch_builder(&kernels.place_buckets);
            launch.arg(&cells).launch(all(each(cells.buckets as usize)))?;
            let mut launch = stream.launch_builder(&kernels.sort_points);
            launch.arg(grid).arg(&at).arg(&cells).launch(all(each(points)))?;
            let mut launch = stream.launch_builder(&kernels.count_edges);
            launch.arg(grid).arg(&at).arg(window).arg(&cells).launch(rows)?;
            let mut launch = stream.launch_builder(&kernels.fill_edges);
            launch.arg(grid).arg(&at).arg(window).arg(&cells).arg(&self.needed).launch(rows)?;
            if capacity > 0 {
                let mut launch = stream.launch_builder(&kernels.reverse_edges);
                launch.arg(&at).launch(all(each(capacity)))?;
            }
        }
        Ok(())
    }

    /// Queues the copy of the most edges of a graph since the last time, for a caller that does not
    /// wait as in [`needed`](Self::needed).
    ///
    /// # Errors
    /// The copy was refused.
    pub fn copy_needed(&mut self, needed: &mut PinnedHostSlice<u64>) -> Result<(), Error> {
        let stream = self.device.stream();
        stream.memcpy_dtoh(&self.needed, needed)?;
        Ok(stream.memset_zeros(&mut self.needed)?)
    }

    /// The most edges of a graph since the last time, once all queued work is done. If that is more
    /// than the graph had room for, it has to be built again in a larger one.
    ///
    /// # Errors
    /// A kernel failed.
    pub fn needed(&mut self) -> Result<usize, Error> {
        let needed = self.device.stream().clone_dtoh(&self.needed)?[0];
        self.device.stream().memset_zeros(&mut self.needed)?;
        Ok(usize::try_from(needed).unwrap_or(usize::MAX))
    }
}
