//! Radius graphs of frames on the device. Their CPU twin is
//! [`radius_graph`](crate::features::radius_graph).

use std::sync::Arc;

use cudarc::driver::{CudaSlice, CudaView, PinnedHostSlice};
use gpu::{ConstPointer, Device, Error, Pointer};

use super::ops::frame_input::DeviceGraph;
use super::ops::graph::{
    Cells, FRAMES, Frame, Frames, Graph, GraphFrames, GraphKernels, Grid, KEPT, ROWS,
};
use crate::network::DIMENSIONS;

/// Fewest cells of a side of the grid: those around a cell are different ones.
const LEAST_SIDE: u32 = 8;
/// Least buckets for each point of a window.
const BUCKETS_PER_POINT: usize = 2;
/// Width of a cell in radii: wider by more than the rounding of a cell's number.
const CELL_WIDTH: f64 = 1.001;

/// The grid for windows of which the largest has so many points.
fn grid(radius: f32, points: usize, largest_window: usize) -> Grid {
    let mut side = LEAST_SIDE;
    while (side as usize).pow(DIMENSIONS as u32) < BUCKETS_PER_POINT * largest_window {
        side *= 2;
    }
    Grid {
        inverse_width: 1.0 / (CELL_WIDTH * f64::from(radius)),
        radius_squared: radius * radius,
        side,
        buckets: side.pow(DIMENSIONS as u32),
        points: points as u32,
    }
}

/// Where lists of these lengths start if they follow each other, and where the last one ends.
pub(super) fn starts(lengths: impl Iterator<Item = usize>) -> Vec<u32> {
    let mut starts = vec![0];
    for length in lengths {
        starts.push(starts[starts.len() - 1] + length as u32);
    }
    starts
}

/// Builds the radius graphs of frames of the same points.
///
/// Launches do not depend on the number of edges, and nothing is read back, so they can be captured
/// in a CUDA graph. [`needed`](Self::needed) tells afterwards whether all edges found room.
pub struct GraphBuilder {
    device: Arc<Device>,
    kernels: GraphKernels,
    grid: Grid,
    /// Points of each window.
    windows: Vec<usize>,
    buffers: Buffers,
    /// Most edges that a graph had, and then each window of the graphs that were [counted](Self::count_windows).
    needed: CudaSlice<u64>,
}

/// Windows and cell lists ([`Cells`]) on the device.
struct Buffers {
    /// Frames, windows and points of all windows together that there is room for.
    frames: usize,
    windows: usize,
    points: usize,
    /// Window of each point.
    window: CudaSlice<u32>,
    /// First point of each window, and the number of all.
    window_start: CudaSlice<u32>,
    count: CudaSlice<u32>,
    first: CudaSlice<u32>,
    bucket: CudaSlice<u32>,
    rank: CudaSlice<u32>,
    /// Four numbers for each point.
    sorted: CudaSlice<f32>,
    neighbours: CudaSlice<u32>,
    block_neighbours: CudaSlice<u32>,
    kept: CudaSlice<u32>,
}

impl Buffers {
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
            window_start: device.zeros(windows + 1)?,
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
    /// For points of which those closer than `radius` (m) are neighbours;
    /// `windows` are the numbers of points of windows side by side, `frames` those made at once.
    ///
    /// # Errors
    /// Too little memory, or no compiler.
    pub fn new(
        device: &Arc<Device>,
        radius: f32,
        windows: &[usize],
        frames: usize,
    ) -> Result<Self, Error> {
        let (points, largest) = (windows.iter().sum(), windows.iter().copied().max().unwrap_or(0));
        let grid = grid(radius, points, largest);
        let mut builder = Self {
            kernels: GraphKernels::load(device)?,
            windows: Vec::new(),
            buffers: Buffers::new(device, windows.len(), points, frames, &grid)?,
            grid,
            needed: device.zeros(1 + windows.len())?,
            device: device.clone(),
        };
        builder.set_windows(windows)?;
        Ok(builder)
    }

    /// Whether there is memory for windows with these numbers of points.
    pub fn fits(&self, windows: &[usize]) -> bool {
        windows.len() <= self.buffers.windows
            && windows.iter().sum::<usize>() <= self.buffers.points
    }

    /// Takes other windows, which must [fit](Self::fits).
    ///
    /// # Errors
    /// The copy was refused.
    ///
    /// # Panics
    /// If they do not fit.
    pub fn set_windows(&mut self, windows: &[usize]) -> Result<(), Error> {
        if self.windows == windows {
            return Ok(());
        }
        assert!(self.fits(windows), "room for {windows:?}");
        let numbered = windows.iter().enumerate();
        let window: Vec<u32> =
            numbered.flat_map(|(k, &n)| std::iter::repeat_n(k as u32, n)).collect();
        let start = starts(windows.iter().copied());
        let stream = self.device.stream();
        stream.memcpy_htod(&start, &mut self.buffers.window_start.slice_mut(..start.len()))?;
        if !window.is_empty() {
            stream.memcpy_htod(&window, &mut self.buffers.window)?;
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
        &self.buffers.window
    }

    /// Allocates a graph of as many points as fit and at most `capacity` edges.
    ///
    /// # Errors
    /// Too little memory.
    pub fn allocate(&self, capacity: usize) -> Result<DeviceGraph, Error> {
        let room = capacity.max(1);
        self.device.reserve(3 * room * size_of::<u32>())?;
        let points = self.buffers.points;
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

    /// Queues the building of the graphs of frames whose positions, points x 2 (m), are
    /// given. A graph with more edges than there is room for is left without any.
    ///
    /// # Errors
    /// A launch was refused.
    pub fn build(&mut self, frames: &mut [(CudaView<f32>, &mut DeviceGraph)]) -> Result<(), Error> {
        if self.points() == 0 {
            return Ok(());
        }
        frames.chunks(self.buffers.frames).try_for_each(|part| self.build_some(part))
    }

    /// Builds as many graphs as there is room for at once.
    fn build_some(&mut self, frames: &[(CudaView<f32>, &mut DeviceGraph)]) -> Result<(), Error> {
        self.device.stream().memset_zeros(&mut self.buffers.count)?;
        let all = GraphFrames {
            grid: self.grid,
            frames: self.frames(frames),
            count: frames.len(),
            window: ConstPointer::to(&self.buffers.window, self.device.stream()),
            cells: self.cells(),
        };
        let capacity = frames.iter().map(|(_, graph)| graph.capacity).max().unwrap_or(0);
        self.kernels.count_buckets(&all)?;
        self.kernels.place_buckets(&all)?;
        self.kernels.sort_points(&all)?;
        self.kernels.count_edges(&all)?;
        self.kernels.fill_edges(&all, Pointer::to(&self.needed, self.device.stream()))?;
        if capacity > 0 {
            self.kernels.reverse_edges(&all, capacity)?;
        }
        Ok(())
    }

    fn cells(&self) -> Cells {
        let (buffers, stream) = (&self.buffers, self.device.stream());
        let to = |array| Pointer::to(array, stream);
        Cells {
            count: to(&buffers.count),
            first: to(&buffers.first),
            bucket: to(&buffers.bucket),
            rank: to(&buffers.rank),
            sorted: Pointer::to(&buffers.sorted, stream).cast(),
            neighbours: to(&buffers.neighbours),
            block_neighbours: to(&buffers.block_neighbours),
            kept: to(&buffers.kept),
            buckets: buffers.windows as u32 * self.grid.buckets,
            points: buffers.points as u32,
            blocks: (buffers.points as u32).div_ceil(ROWS),
        }
    }

    fn frames(&self, frames: &[(CudaView<f32>, &mut DeviceGraph)]) -> Frames {
        let stream = self.device.stream();
        let to = |array| Pointer::to(array, stream);
        let mut all = Frames::default();
        for (frame, (position, graph)) in all.of.iter_mut().zip(frames) {
            debug_assert_eq!(position.len(), self.points() * DIMENSIONS);
            *frame = Frame {
                position: ConstPointer::to(position, stream),
                graph: Graph {
                    start: to(&graph.start),
                    sender: to(&graph.sender),
                    receiver: to(&graph.receiver),
                    reverse: to(&graph.reverse),
                    nodes: to(&graph.nodes),
                    edges: to(&graph.edges),
                    capacity: graph.capacity as u32,
                },
            };
        }
        all
    }

    /// Queues the count of the edges of each window of a graph, for [`copy_needed`](Self::copy_needed).
    ///
    /// # Errors
    /// The launch was refused.
    pub fn count_windows(&mut self, graph: &DeviceGraph) -> Result<(), Error> {
        if self.points() == 0 {
            return Ok(());
        }
        let stream = self.device.stream();
        self.kernels.window_edges(
            ConstPointer::to(&graph.start, stream),
            ConstPointer::to(&self.buffers.window_start, stream),
            self.windows.len(),
            Pointer::to(&self.needed, stream).offset(1),
        )
    }

    /// Queues the copy of the most edges of a graph since the last time, and of each window of the graphs that were
    /// [counted](Self::count_windows), for a caller that does not wait as in [`needed`](Self::needed). A graph that
    /// had no room counts for the former alone.
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

#[cfg(test)]
mod tests {
    use super::starts;

    #[test]
    fn lists_start_where_the_last_one_ends() {
        assert_eq!(starts([3, 0, 2].into_iter()), [0, 3, 3, 5]);
        assert_eq!(starts(std::iter::empty()), [0]);
    }
}
