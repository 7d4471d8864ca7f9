//! Graph and features of a frame on the device: what the networks read.

use cudarc::driver::CudaSlice;

/// Radius graph of one frame (of a whole batch: block-diagonal) on the device, edges in order of
/// receiver, then sender.
#[derive(Debug)]
pub struct DeviceGraph {
    /// Nodes, of all windows of the batch together, that there is memory for. Kernels are launched for
    /// this many and return beyond `nodes`.
    pub points: usize,
    /// The same of edges.
    pub capacity: usize,
    /// First edge of each receiver (points + 1).
    pub start: CudaSlice<u32>,
    /// Sender of each edge (capacity).
    pub sender: CudaSlice<u32>,
    /// Receiver of each edge (capacity).
    pub receiver: CudaSlice<u32>,
    /// Index of the edge with sender and receiver swapped (capacity): the graph is symmetric, so
    /// the gradient with respect to senders is a gather, without atomics.
    pub reverse: CudaSlice<u32>,
    /// Number of nodes (1), on the device, so that a CUDA graph can be replayed while it changes.
    pub nodes: CudaSlice<u32>,
    /// Number of edges (1).
    pub edges: CudaSlice<u32>,
}

/// What a network reads of one frame; features are row-major.
#[derive(Debug)]
pub struct FrameInput {
    /// Which nodes are neighbours.
    pub graph: DeviceGraph,
    /// Features of nodes (points x columns).
    pub node: CudaSlice<f32>,
    /// Features of edges (capacity x columns).
    pub edge: CudaSlice<f32>,
}
