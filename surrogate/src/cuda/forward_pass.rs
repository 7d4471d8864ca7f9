//! The forward pass: the network of [`crate::network`], launch by launch.

use std::ops::Range;

use gpu::{ConstPointer, Pointer};

use super::activations::{FrameActivations, MlpActivations};
use super::error::CudaError;
use super::network::{CudaNetwork, FrameView};
use super::ops::forward::{Forward, NO_OFFSET};
use super::ops::segment::{Receive, SameEdges};
use super::ops::tile::Stored;

/// Edge states as a message layer reads them.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgeState {
    pub states: Pointer<Stored>,
    /// Offset of the LayerNorm whose scale and shift have yet to be applied, or [`NO_OFFSET`].
    pub norm: i32,
}

impl CudaNetwork {
    /// The network on a window, the oldest frame first; `save_activations`: for a backward pass.
    pub(super) fn forward_pass(
        &self,
        views: &[FrameView],
        save_activations: bool,
    ) -> Result<(), CudaError> {
        self.kernels.launcher.begin_pass(save_activations);
        let training = self.activations.gradients.is_some();
        if training {
            self.encode(&views.iter().enumerate().collect::<Vec<_>>())?;
        }
        for layer in 0..self.layout.layers.len() {
            let view = &views[layer.min(views.len() - 1)];
            if layer < views.len() {
                if !training {
                    self.encode(&[(layer, view)])?;
                }
                if layer > 0 {
                    self.fuse(layer..layer + 1, &views[layer - 1], view)?;
                }
            }
            self.message_layers(layer..layer + 1, view)?;
        }
        self.decode(&views[0])
    }

    /// Encodes nodes and edges of frames.
    pub(super) fn encode(&self, frames: &[(usize, &FrameView)]) -> Result<(), CudaError> {
        let nodes: Vec<_> = frames.iter().map(|(k, view)| self.node_encoder(*k, view)).collect();
        self.kernels.forward.mlp_forward(&nodes, self.nodes())?;
        let edges: Vec<_> = frames.iter().map(|(k, view)| self.edge_encoder(*k, view)).collect();
        self.kernels.forward.mlp_forward(&edges, self.edges())
    }

    fn node_encoder(&self, frame: usize, view: &FrameView) -> Forward {
        let (mlp, _) = self.layout.encoders(frame);
        let activations = &self.activations.frames[frame];
        let item = Forward {
            features: view.node_features.values,
            feature_stride: view.node_features.stride as i32,
            count: view.nodes,
            output: activations.node,
            ..self.mlp(mlp)
        };
        item.saving(&activations.node_encoder)
    }

    fn edge_encoder(&self, frame: usize, view: &FrameView) -> Forward {
        let (_, mlp) = self.layout.encoders(frame);
        let activations = &self.activations.frames[frame];
        let item = Forward { output: activations.edge, ..self.mlp(mlp) };
        item.reading_edges(view).saving(&activations.edge_encoder)
    }

    /// The encoded edges of a frame.
    fn encoded_edges(&self, frame: usize) -> EdgeState {
        let activations = &self.activations.frames[frame];
        if !activations.edge.is_null() {
            return EdgeState { states: activations.edge, norm: NO_OFFSET };
        }
        let (_, mlp) = self.layout.encoders(frame);
        let norm = self.layout.mlps[mlp].scale() as i32;
        EdgeState { states: activations.edge_encoder.normal, norm }
    }

    /// The messages of a layer as edge states.
    pub(super) fn messages(&self, layer: usize) -> EdgeState {
        let activations = &self.activations.layers[layer];
        if !activations.edge.is_null() {
            return EdgeState { states: activations.edge, norm: NO_OFFSET };
        }
        let mlp = &self.layout.mlps[self.layout.layers[layer].message];
        EdgeState { states: activations.message.normal, norm: mlp.scale() as i32 }
    }

    /// Edge states that a layer reads.
    pub(super) fn edge_state(&self, layer: usize) -> EdgeState {
        if layer < self.layout.frames {
            self.encoded_edges(layer)
        } else {
            self.messages(layer - 1)
        }
    }

    /// Node states that a layer reads.
    pub(super) fn node_state(&self, layer: usize) -> Pointer<Stored> {
        let Self { activations, layout, .. } = self;
        if layer == 0 {
            activations.frames[0].node
        } else if layer < layout.frames {
            activations.frames[layer].fused
        } else {
            activations.layers[layer - 1].node
        }
    }

    /// Accelerations from the node states of the last layer.
    pub(super) fn decode(&self, view: &FrameView) -> Result<(), CudaError> {
        let last = self.layout.layers.len() - 1;
        let decoder = Forward {
            x: [self.activations.layers[last].node.into(), ConstPointer::NULL],
            count: view.nodes,
            narrow: Pointer::to(&self.output, self.device().stream()),
            ..self.mlp(self.layout.decoder)
        };
        let decoder = decoder.saving(&self.activations.decoder);
        self.kernels.forward.mlp_forward(&[decoder], self.nodes())
    }

    /// S joins the node states of the previous frame with the encoded nodes; `edgemsg` the previous
    /// frame's messages with the features of edges that both frames have. For the layers of one
    /// frame, or of several that all have the same graph.
    pub(super) fn fuse(
        &self,
        frames: Range<usize>,
        before: &FrameView,
        view: &FrameView,
    ) -> Result<(), CudaError> {
        let nodes = frames.clone().map(|frame| {
            let activations = &self.activations.frames[frame];
            let previous = self.activations.layers[frame - 1].node;
            let item = Forward {
                x: [previous.into(), activations.node.into()],
                count: view.nodes,
                output: activations.fused,
                ..self.mlp(self.layout.node_fusion)
            };
            item.saving(&activations.node_fusion)
        });
        self.kernels.forward.mlp_forward(&nodes.collect::<Vec<_>>(), self.nodes())?;
        let Some(fusion) = self.layout.edge_fusion else { return Ok(()) };

        let FrameActivations { previous, next, .. } = self.activations.frames[frames.start];
        self.kernels.segment.same_edges(&same_edges(view, before, previous))?;
        if !next.is_null() {
            self.kernels.segment.same_edges(&same_edges(before, view, next))?;
        }
        let edges = frames.map(|frame| {
            let activations = &self.activations.frames[frame];
            let messages = self.messages(frame - 1);
            let item = Forward {
                x: [messages.states.into(), ConstPointer::NULL],
                input_norm: messages.norm,
                index: activations.previous.into(),
                output: activations.edge,
                ..self.mlp(fusion)
            };
            item.reading_edges(view).saving(&activations.edge_fusion)
        });
        self.kernels.forward.mlp_forward(&edges.collect::<Vec<_>>(), self.edges())
    }

    /// Layers side by side on one graph.
    pub(super) fn message_layers(
        &self,
        layers: Range<usize>,
        view: &FrameView,
    ) -> Result<(), CudaError> {
        self.first_linears(layers.clone(), view)?;
        self.message_mlps(layers.clone(), view)?;
        self.receive_messages(layers.clone(), view)?;
        self.update_nodes(layers, view)
    }

    /// The parts of the messages' first linears that are the same for all edges of a node.
    fn first_linears(&self, layers: Range<usize>, view: &FrameView) -> Result<(), CudaError> {
        let parts = layers.flat_map(|layer| {
            let (mlps, activations) = (&self.layout.layers[layer], &self.activations.layers[layer]);
            let state = self.node_state(layer).into();
            let parts = [(mlps.sender, activations.sender), (mlps.receiver, activations.receiver)];
            parts.map(|(packed, output)| Forward {
                x: [state, ConstPointer::NULL],
                count: view.nodes,
                output,
                ..self.linear(packed)
            })
        });
        self.kernels.forward.mlp_forward(&parts.collect::<Vec<_>>(), self.nodes())
    }

    fn message_mlps(&self, layers: Range<usize>, view: &FrameView) -> Result<(), CudaError> {
        let messages = layers.map(|layer| {
            let (mlps, activations) = (&self.layout.layers[layer], &self.activations.layers[layer]);
            let edge = self.edge_state(layer);
            let residual = self.layout.residual && !activations.edge.is_null();
            let item = Forward {
                x: [edge.states.into(), ConstPointer::NULL],
                input_norm: edge.norm,
                added: [activations.sender.into(), activations.receiver.into()],
                added_index: [view.sender, view.receiver],
                count: view.edges,
                output: activations.edge,
                residual: if residual { edge.states.into() } else { ConstPointer::NULL },
                sums: activations.sums,
                ..self.mlp(mlps.message)
            };
            item.saving(&activations.message)
        });
        self.kernels.forward.mlp_forward(&messages.collect::<Vec<_>>(), self.edges())
    }

    fn receive_messages(&self, layers: Range<usize>, view: &FrameView) -> Result<(), CudaError> {
        let receive = layers.map(|layer| {
            let activations = &self.activations.layers[layer];
            let mlp = &self.layout.mlps[self.layout.layers[layer].message];
            Receive {
                nodes: view.nodes,
                start: view.start,
                sums: activations.sums.into(),
                parameters: self.pointer(&self.parameters),
                received: activations.received,
                norm: mlp.scale() as i32,
                width: mlp.width as i32,
            }
        });
        self.kernels.segment.receive(&receive.collect::<Vec<_>>(), self.nodes())
    }

    fn update_nodes(&self, layers: Range<usize>, view: &FrameView) -> Result<(), CudaError> {
        let updates = layers.map(|layer| {
            let (mlps, activations) = (&self.layout.layers[layer], &self.activations.layers[layer]);
            let state = self.node_state(layer).into();
            let item = Forward {
                x: [state, activations.received.into()],
                count: view.nodes,
                output: activations.node,
                residual: if self.layout.adds_to_nodes(layer) { state } else { ConstPointer::NULL },
                ..self.mlp(mlps.update)
            };
            item.saving(&activations.update)
        });
        self.kernels.forward.mlp_forward(&updates.collect::<Vec<_>>(), self.nodes())
    }
}

/// For each edge of `view` the same edge of `other`.
fn same_edges(view: &FrameView, other: &FrameView, same: Pointer<u32>) -> SameEdges {
    SameEdges {
        edges: view.edges,
        sender: view.sender,
        receiver: view.receiver,
        other_start: other.start,
        other_sender: other.sender,
        same,
    }
}

impl Forward {
    /// With the features of a frame's edges.
    fn reading_edges(self, view: &FrameView) -> Self {
        Self {
            features: view.edge_features.values,
            feature_stride: view.edge_features.stride as i32,
            count: view.edges,
            ..self
        }
    }

    /// With places for what the backward pass needs.
    fn saving(self, saved: &MlpActivations) -> Self {
        Self {
            hidden: saved.hidden,
            stride: saved.stride as u64,
            normal: saved.normal,
            deviation: saved.deviation,
            ..self
        }
    }
}
