//! Upload of frames whose graphs and features the host computed.

use std::sync::Arc;

use cudarc::driver::{CudaSlice, DeviceRepr};
use gpu::Device;

use super::error::CudaError;
use super::ops::frame_input::{DeviceGraph, FrameInput};
use crate::features::HostFrame;

/// A frame in host memory, laid out as [`FrameInput`].
#[derive(Clone, Debug)]
pub struct HostInput {
    /// Number of nodes.
    pub points: usize,
    /// Features of a node and of an edge.
    pub columns: [usize; 2],
    /// Features of nodes (points x columns) and of edges (edges x columns).
    pub nodes: Vec<f32>,
    /// See `nodes`.
    pub edges: Vec<f32>,
    /// First edge of each receiver (points + 1).
    pub start: Vec<u32>,
    /// Sender of each edge.
    pub sender: Vec<u32>,
    /// Receiver of each edge.
    pub receiver: Vec<u32>,
    /// Index of each edge's reverse.
    pub reverse: Vec<u32>,
}

impl From<HostFrame> for HostInput {
    fn from(frame: HostFrame) -> Self {
        let mut start = vec![0_u32; frame.points + 1];
        for &(receiver, _) in &frame.pairs {
            start[receiver as usize + 1] += 1;
        }
        for v in 0..frame.points {
            start[v + 1] += start[v];
        }
        // Receivers ascend, so the reverses of a sender's edges come in the order of its own row.
        let mut next = start.clone();
        let reverse = frame
            .pairs
            .iter()
            .map(|&(_, sender)| {
                let next = &mut next[sender as usize];
                *next += 1;
                *next - 1
            })
            .collect();
        Self {
            points: frame.points,
            columns: frame.columns,
            nodes: frame.nodes,
            edges: frame.edges,
            start,
            sender: frame.pairs.iter().map(|&(_, sender)| sender as u32).collect(),
            receiver: frame.pairs.iter().map(|&(receiver, _)| receiver as u32).collect(),
            reverse,
        }
    }
}

impl FrameInput {
    /// An empty frame with memory for `points` and `edges` with so many features (`columns`) each.
    ///
    /// # Errors
    /// If the GPU's memory is too small.
    pub(super) fn with_capacity(
        device: &Arc<Device>,
        points: usize,
        edges: usize,
        columns: [usize; 2],
    ) -> Result<Self, CudaError> {
        let (points, edges) = (points.max(1), edges.max(1));
        Ok(Self {
            graph: DeviceGraph {
                points,
                capacity: edges,
                start: device.zeros(points + 1)?,
                sender: device.zeros(edges)?,
                receiver: device.zeros(edges)?,
                reverse: device.zeros(edges)?,
                nodes: device.zeros(1)?,
                edges: device.zeros(1)?,
            },
            node: device.zeros(points * columns[0])?,
            edge: device.zeros(edges * columns[1])?,
        })
    }

    /// Takes another frame.
    ///
    /// # Errors
    /// If it is too large.
    pub(super) fn fill(&mut self, device: &Device, frame: &HostInput) -> Result<(), CudaError> {
        let graph = &mut self.graph;
        copy(device, "points", &frame.start, &mut graph.start)?;
        copy(device, "edges", &frame.sender, &mut graph.sender)?;
        copy(device, "edges", &frame.receiver, &mut graph.receiver)?;
        copy(device, "edges", &frame.reverse, &mut graph.reverse)?;
        copy(device, "points", &[frame.points as u32], &mut graph.nodes)?;
        copy(device, "edges", &[frame.sender.len() as u32], &mut graph.edges)?;
        copy(device, "node features", &frame.nodes, &mut self.node)?;
        copy(device, "edge features", &frame.edges, &mut self.edge)?;
        Ok(())
    }
}

/// Copies a frame to the GPU, with memory for `capacity` edges.
///
/// # Errors
/// If the frame has more edges, or the GPU's memory is too small.
pub fn upload(
    device: &Arc<Device>,
    frame: &HostInput,
    capacity: usize,
) -> Result<FrameInput, CudaError> {
    let mut input = FrameInput::with_capacity(device, frame.points, capacity, frame.columns)?;
    input.fill(device, frame)?;
    Ok(input)
}

fn copy<T: DeviceRepr>(
    device: &Device,
    what: &'static str,
    list: &[T],
    to: &mut CudaSlice<T>,
) -> Result<(), CudaError> {
    let (found, room) = (list.len(), to.len());
    if found > room {
        return Err(CudaError::Capacity { what, found, room });
    }
    if found > 0 {
        device.stream().memcpy_htod(list, &mut to.slice_mut(..found))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reverses() {
        let mut pairs = Vec::new();
        for (v, w) in [(0, 2), (0, 4), (1, 2), (2, 4), (2, 5)] {
            pairs.extend([(v, w), (w, v)]);
        }
        pairs.sort_unstable();
        let (nodes, edges) = (Vec::new(), Vec::new());
        let frame = HostFrame { points: 6, columns: [0, 0], nodes, edges, pairs: pairs.clone() };
        let input = HostInput::from(frame);
        assert_eq!(input.start, [0, 2, 3, 7, 7, 9, 10]);
        for (edge, &reverse) in input.reverse.iter().enumerate() {
            let (v, w) = pairs[edge];
            assert_eq!(pairs[reverse as usize], (w, v));
        }
    }
}
