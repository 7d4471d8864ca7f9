//! A network on a GPU: its weights, and room for the states of a batch.

use std::sync::Arc;

use cudarc::driver::{CudaSlice, DevicePtr};
use gpu::Device;

use super::arguments::{Address, Forward};
use super::buffers::FrameInput;
use super::error::CudaError;
use super::kernels::{Kernels, Rows, WIDTH};
use super::layout::{Layout, Packed};
use super::room::Room;
use crate::network::{ModelConfig, ModelKind, Precision};

/// Hidden layers of an MLP whose biases fit beside a matrix in shared memory, and features whose
/// products do.
pub(super) const MOST_LAYERS: usize = 16;
const MOST_FEATURES: usize = 32;

/// A network on a GPU.
#[derive(Debug)]
pub struct CudaNetwork {
    pub(super) kernels: Kernels,
    pub(super) layout: Layout,
    pub(super) config: ModelConfig,
    pub(super) parameters: CudaSlice<f32>,
    packed: CudaSlice<u32>,
    packs: CudaSlice<super::arguments::Pack>,
    pub(super) room: Room,
    /// Normalised accelerations, points x dimensions.
    pub(super) output: CudaSlice<f32>,
}

/// Whether the kernels can compute networks like this.
///
/// # Errors
/// If one of its sizes is too large: which.
pub fn supports(config: &ModelConfig) -> Result<(), CudaError> {
    let mut limits =
        vec![("width", config.width, WIDTH), ("hidden_layers", config.hidden_layers, MOST_LAYERS)];
    if config.kind == ModelKind::Gns {
        let velocities = MOST_FEATURES.saturating_sub(config.first_node_features());
        limits.push(("frames", config.frames, velocities / config.dimensions + 1));
    }
    for (key, value, most) in limits {
        if value > most {
            return Err(CudaError::Unsupported { key, value, most });
        }
    }
    Ok(())
}

/// How much a network has to have room for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Capacity {
    /// Points of all windows together.
    pub points: usize,
    /// Edges of a frame.
    pub edges: usize,
}

/// A frame's graph and features, as addresses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct View {
    /// Numbers of nodes and of edges.
    pub nodes: Address,
    pub edges: Address,
    pub start: Address,
    pub sender: Address,
    pub receiver: Address,
    pub reverse: Address,
    pub node: Features,
    pub edge: Features,
}

/// Features of nodes or edges; their rows may be parts of longer ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Features {
    pub at: Address,
    pub stride: usize,
}

impl CudaNetwork {
    /// A network with weights all zero. `training`: with room for what gradients need.
    ///
    /// # Errors
    /// If the kernels do not [support](supports) the network, or the GPU's memory is too small.
    pub fn new(
        device: &Arc<Device>,
        config: &ModelConfig,
        precision: Precision,
        capacity: Capacity,
        training: bool,
    ) -> Result<Self, CudaError> {
        supports(config)?;
        let kernels = Kernels::load(device, precision)?;
        let layout = Layout::new(config, precision, kernels.fused());
        let room = Room::new(device, &layout, &kernels, capacity, training)?;
        Ok(Self {
            parameters: device.zeros(layout.parameters)?,
            packed: device.zeros(4 * layout.words)?,
            packs: device.upload(&layout.packs)?,
            output: device.zeros(capacity.points * layout.dimensions)?,
            config: config.clone(),
            kernels,
            layout,
            room,
        })
    }

    /// Takes weights in the order of [`crate::network::parameters::weights`].
    ///
    /// # Errors
    /// If their number is not that of the network.
    pub fn set_weights(&mut self, weights: &[f32]) -> Result<(), CudaError> {
        let expected = self.layout.parameters;
        if weights.len() != expected {
            return Err(CudaError::Weights { found: weights.len(), expected });
        }
        self.kernels.device.stream().memcpy_htod(weights, &mut self.parameters)?;
        self.pack()
    }

    /// Takes the weights of a network that is the same but for its room. Does not wait.
    ///
    /// # Errors
    /// The copy was refused.
    pub(super) fn copy_weights(&mut self, other: &Self) -> Result<(), CudaError> {
        let stream = self.kernels.device.stream();
        stream.memcpy_dtod(&other.parameters, &mut self.parameters)?;
        Ok(stream.memcpy_dtod(&other.packed, &mut self.packed)?)
    }

    /// Makes room for larger batches, if need be.
    ///
    /// # Errors
    /// If the GPU's memory is too small.
    pub fn grow(&mut self, capacity: Capacity) -> Result<(), CudaError> {
        let old = self.room.capacity;
        if capacity.points <= old.points && capacity.edges <= old.edges {
            return Ok(());
        }
        let new = Capacity {
            points: capacity.points.max(old.points),
            edges: capacity.edges.max(old.edges),
        };
        let device = self.kernels.device.clone();
        let training = self.room.training.is_some();
        self.room.clear();
        self.room = Room::new(&device, &self.layout, &self.kernels, new, training)?;
        self.output = device.zeros(new.points * self.layout.dimensions)?;
        Ok(())
    }

    /// Times of what `work` launches: name of the kernel, launches, ms. Waits.
    ///
    /// # Errors
    /// Those of `work`, or if a kernel failed.
    pub fn profile(
        &self,
        work: impl FnOnce(&Self) -> Result<(), CudaError>,
    ) -> Result<Vec<(&'static str, usize, f32)>, CudaError> {
        self.kernels.profile.begin();
        let done = work(self);
        let times = self.kernels.profile.end();
        done?;
        times
    }

    /// What there is room for.
    pub fn capacity(&self) -> Capacity {
        self.room.capacity
    }

    /// Brings the packed weights up to date with the list.
    pub(super) fn pack(&self) -> Result<(), CudaError> {
        let (packs, packed) = (self.address(&self.packs), self.address(&self.packed));
        self.kernels.pack(packs, self.layout.packs.len(), self.address(&self.parameters), packed)
    }

    /// Normalised accelerations (points x dimensions, at the start of the list) of a window or a
    /// batch of windows, the oldest frame first. Does not wait.
    ///
    /// # Errors
    /// If there are more points or edges than there is room for.
    pub fn forward(&mut self, frames: &[FrameInput]) -> Result<&CudaSlice<f32>, CudaError> {
        let views = self.views(frames)?;
        self.pass(&views, false)?;
        Ok(&self.output)
    }

    /// The frames of a window that starts with them.
    pub(super) fn views(&self, frames: &[FrameInput]) -> Result<Vec<View>, CudaError> {
        let config = &self.config;
        let (node, edge) = (config.later_node_features(), config.later_edge_features());
        let first = match config.kind {
            ModelKind::Tgnns => (config.first_node_features(), config.first_edge_features()),
            ModelKind::Gns => (config.gns_node_features(), config.first_edge_features()),
        };
        let mut views = Vec::new();
        for (k, frame) in frames.iter().enumerate() {
            views.push(self.view(frame, if k == 0 { first } else { (node, edge) }, 0)?);
        }
        if views.len() != self.layout.frames {
            let (found, room) = (views.len(), self.layout.frames);
            return Err(CudaError::Room { what: "frames", found, room });
        }
        Ok(views)
    }

    /// A frame whose rows of node and edge features are this long, of which `skipped` are left out
    /// at the start.
    pub(super) fn view(
        &self,
        frame: &FrameInput,
        (node, edge): (usize, usize),
        skipped: usize,
    ) -> Result<View, CudaError> {
        let (graph, room) = (&frame.graph, self.room.capacity);
        for (what, found, room) in
            [("points", graph.points, room.points), ("edges", graph.capacity, room.edges)]
        {
            if found > room {
                return Err(CudaError::Room { what, found, room });
            }
        }
        let features = |list: &CudaSlice<f32>, stride| Features {
            at: self.address(list) + 4 * skipped as u64,
            stride,
        };
        Ok(View {
            nodes: self.address(&graph.nodes),
            edges: self.address(&graph.edges),
            start: self.address(&graph.start),
            sender: self.address(&graph.sender),
            receiver: self.address(&graph.receiver),
            reverse: self.address(&graph.reverse),
            node: features(&frame.node, node),
            edge: features(&frame.edge, edge),
        })
    }

    pub(super) fn address<T>(&self, slice: &CudaSlice<T>) -> Address {
        slice.device_ptr(self.kernels.device.stream()).0
    }

    /// Rows of a launch over nodes, and over edges.
    pub(super) fn nodes(&self) -> Rows {
        Rows { edges: false, most: self.room.capacity.points }
    }

    pub(super) fn edges(&self) -> Rows {
        Rows { edges: true, most: self.room.capacity.edges }
    }

    /// What launches of an MLP have in common.
    pub(super) fn mlp(&self, mlp: usize) -> Forward {
        let m = &self.layout.mlps[mlp];
        let bias_stride = m.width * m.width + m.width;
        Forward {
            bias: m.bias(0) as i32,
            bias_stride: bias_stride as i32,
            last_bias: m.bias(m.layers) as i32,
            norm: if m.norm { m.scale() as i32 } else { -1 },
            layers: m.layers as i32,
            columns: m.columns as i32,
            feature_count: m.features() as i32,
            feature_steps: m.feature_steps() as i32,
            ..self.linear(m.forward)
        }
    }

    /// A linear without bias.
    pub(super) fn linear(&self, packed: Packed) -> Forward {
        Forward {
            weights: self.packed_at(packed),
            units: packed.words as i32,
            parameters: self.address(&self.parameters),
            bias: -1,
            last_bias: -1,
            norm: -1,
            input_norm: -1,
            width: self.config.width as i32,
            columns: WIDTH as i32,
            slope: self.layout.slope,
            ..Forward::default()
        }
    }

    pub(super) fn packed_at(&self, packed: Packed) -> Address {
        self.address(&self.packed) + 16 * packed.at as u64
    }
}
