//! A network on a GPU: its weights, and memory for the states of a batch.

use std::sync::Arc;

use cudarc::driver::CudaSlice;
use gpu::{ConstPointer, Device};

use super::activations::Activations;
use super::error::CudaError;
use super::layout::{Layout, Packed};
use super::ops::forward::{Forward, NO_OFFSET};
use super::ops::frame_input::FrameInput;
use super::ops::kernels::Kernels;
use super::ops::launcher::Rows;
use super::ops::tile::{WIDTH, Word};
use super::ops::weights::Pack;
use super::support::{Capacity, supports};
use crate::network::{ModelConfig, ModelKind, Precision};

/// A network on a GPU.
#[derive(Debug)]
pub struct CudaNetwork {
    pub(super) kernels: Kernels,
    pub(super) layout: Layout,
    pub(super) config: ModelConfig,
    /// All weights, in the order of [`weights`](crate::network::parameters::weights).
    pub(super) parameters: CudaSlice<f32>,
    /// The matrices among them as the kernels read them.
    packed: CudaSlice<Word>,
    packs: CudaSlice<Pack>,
    pub(super) activations: Activations,
    /// Normalised accelerations, points x dimensions.
    pub(super) output: CudaSlice<f32>,
}

/// A frame's graph and features on the device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct FrameView {
    /// Numbers of nodes and of edges (1).
    pub nodes: ConstPointer<u32>,
    pub edges: ConstPointer<u32>,
    /// First edge of each node (nodes + 1).
    pub start: ConstPointer<u32>,
    /// Of each edge.
    pub sender: ConstPointer<u32>,
    pub receiver: ConstPointer<u32>,
    pub reverse: ConstPointer<u32>,
    pub node_features: FeatureRows,
    pub edge_features: FeatureRows,
}

/// Features of nodes or edges; their rows may be parts of longer ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct FeatureRows {
    pub values: ConstPointer<f32>,
    /// Numbers from one row to the next.
    pub stride: usize,
}

impl CudaNetwork {
    /// A network with weights all zero. `training`: with memory for what gradients need.
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
        let activations = Activations::new(&layout, &kernels.launcher, capacity, training)?;
        Ok(Self {
            parameters: device.zeros(layout.parameters)?,
            packed: device.zeros(layout.words)?,
            packs: device.upload(&layout.packs)?,
            output: device.zeros(capacity.points * layout.dimensions)?,
            config: config.clone(),
            kernels,
            layout,
            activations,
        })
    }

    /// Takes weights in the order of [`weights`](crate::network::parameters::weights).
    ///
    /// # Errors
    /// If their number is not that of the network.
    pub fn set_weights(&mut self, weights: &[f32]) -> Result<(), CudaError> {
        let expected = self.layout.parameters;
        if weights.len() != expected {
            return Err(CudaError::Weights { found: weights.len(), expected });
        }
        self.kernels.launcher.device.stream().memcpy_htod(weights, &mut self.parameters)?;
        self.pack()
    }

    /// Takes the weights of a network that is the same but for its capacity. Does not wait.
    ///
    /// # Errors
    /// The copy was refused.
    pub(super) fn copy_weights(&mut self, other: &Self) -> Result<(), CudaError> {
        let stream = self.kernels.launcher.device.stream();
        stream.memcpy_dtod(&other.parameters, &mut self.parameters)?;
        Ok(stream.memcpy_dtod(&other.packed, &mut self.packed)?)
    }

    /// Grows to this capacity, if need be.
    ///
    /// # Errors
    /// If the GPU's memory is too small.
    pub fn grow(&mut self, capacity: Capacity) -> Result<(), CudaError> {
        let old = self.activations.capacity;
        if capacity.points <= old.points && capacity.edges <= old.edges {
            return Ok(());
        }
        let new = Capacity {
            points: capacity.points.max(old.points),
            edges: capacity.edges.max(old.edges),
        };
        let training = self.activations.gradients.is_some();
        self.activations.clear();
        self.activations = Activations::new(&self.layout, &self.kernels.launcher, new, training)?;
        self.output = self.device().zeros(new.points * self.layout.dimensions)?;
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
        let profile = &self.kernels.launcher.profile;
        profile.begin();
        let done = work(self);
        let times = profile.end();
        done?;
        times
    }

    /// What there is memory for.
    pub fn capacity(&self) -> Capacity {
        self.activations.capacity
    }

    pub(super) fn device(&self) -> &Arc<Device> {
        &self.kernels.launcher.device
    }

    /// Packs the weights.
    pub(super) fn pack(&self) -> Result<(), CudaError> {
        self.kernels.weights.pack_weights(&self.packs, &self.parameters, &self.packed)
    }

    /// Normalised accelerations (points x dimensions, at the start of the list) of a window or a
    /// batch of windows, the oldest frame first. Does not wait.
    ///
    /// # Errors
    /// If there are more points or edges than there is memory for.
    pub fn forward(&mut self, frames: &[FrameInput]) -> Result<&CudaSlice<f32>, CudaError> {
        let views = self.views(frames)?;
        self.forward_pass(&views, false)?;
        Ok(&self.output)
    }

    /// The frames of a window.
    pub(super) fn views(&self, frames: &[FrameInput]) -> Result<Vec<FrameView>, CudaError> {
        let config = &self.config;
        let later = [config.later_node_features(), config.later_edge_features()];
        let first = match config.kind {
            ModelKind::Tgnns => [config.first_node_features(), config.first_edge_features()],
            ModelKind::Gns => [config.gns_node_features(), config.first_edge_features()],
        };
        let mut views = Vec::new();
        for (k, frame) in frames.iter().enumerate() {
            views.push(self.view(frame, if k == 0 { first } else { later }, 0)?);
        }
        if views.len() != self.layout.frames {
            let (found, room) = (views.len(), self.layout.frames);
            return Err(CudaError::Capacity { what: "frames", found, room });
        }
        Ok(views)
    }

    /// A frame whose rows of node and edge features are this long, of which `skipped` are left out
    /// at the start.
    pub(super) fn view(
        &self,
        frame: &FrameInput,
        [node, edge]: [usize; 2],
        skipped: usize,
    ) -> Result<FrameView, CudaError> {
        let (graph, capacity) = (&frame.graph, self.activations.capacity);
        for (what, found, room) in
            [("points", graph.points, capacity.points), ("edges", graph.capacity, capacity.edges)]
        {
            if found > room {
                return Err(CudaError::Capacity { what, found, room });
            }
        }
        let features = |list: &CudaSlice<f32>, stride| FeatureRows {
            values: self.pointer(list).offset(skipped),
            stride,
        };
        Ok(FrameView {
            nodes: self.pointer(&graph.nodes),
            edges: self.pointer(&graph.edges),
            start: self.pointer(&graph.start),
            sender: self.pointer(&graph.sender),
            receiver: self.pointer(&graph.receiver),
            reverse: self.pointer(&graph.reverse),
            node_features: features(&frame.node, node),
            edge_features: features(&frame.edge, edge),
        })
    }

    pub(super) fn pointer<T>(&self, slice: &CudaSlice<T>) -> ConstPointer<T> {
        ConstPointer::to(slice, self.device().stream())
    }

    /// Rows of a launch over nodes.
    pub(super) fn nodes(&self) -> Rows {
        Rows { edges: false, max: self.activations.capacity.points }
    }

    /// Rows of a launch over edges.
    pub(super) fn edges(&self) -> Rows {
        Rows { edges: true, max: self.activations.capacity.edges }
    }

    /// What all forward launches of an MLP have in common.
    pub(super) fn mlp(&self, mlp: usize) -> Forward {
        let m = &self.layout.mlps[mlp];
        let bias_stride = m.width * m.width + m.width;
        Forward {
            bias: m.bias(0) as i32,
            bias_stride: bias_stride as i32,
            last_bias: m.bias(m.layers) as i32,
            norm: if m.norm { m.scale() as i32 } else { NO_OFFSET },
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
            weights: self.packed(packed),
            units: packed.words as i32,
            parameters: self.pointer(&self.parameters),
            bias: NO_OFFSET,
            last_bias: NO_OFFSET,
            norm: NO_OFFSET,
            input_norm: NO_OFFSET,
            width: self.config.width as i32,
            columns: WIDTH as i32,
            slope: self.layout.slope,
            ..Forward::default()
        }
    }

    /// The first word of packed matrices.
    pub(super) fn packed(&self, packed: Packed) -> ConstPointer<Word> {
        self.pointer(&self.packed).offset(packed.first)
    }
}
