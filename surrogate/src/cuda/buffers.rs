//! What the networks read on the device.

use cudarc::driver::CudaSlice;

/// Radius graph of one frame (of a whole batch: block-diagonal) on the device, edges in order of
/// receiver, then sender.
#[derive(Debug)]
pub struct DeviceGraph {
    /// Nodes (of all windows of the batch together) and edges that the buffers have room for;
    /// kernels are launched for this many and return beyond `nodes` and `edges`.
    pub points: usize,
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
    /// Numbers of nodes and of edges (1), on the device, so that a CUDA graph can be replayed while
    /// they change.
    pub nodes: CudaSlice<u32>,
    pub edges: CudaSlice<u32>,
}

/// What the network reads of one frame, float32 row-major.
#[derive(Debug)]
pub struct FrameInput {
    pub graph: DeviceGraph,
    /// Points x node features.
    pub node: CudaSlice<f32>,
    /// Capacity x edge features.
    pub edge: CudaSlice<f32>,
}
