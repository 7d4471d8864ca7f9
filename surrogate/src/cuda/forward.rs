//! The forward pass: as `crate::network`.

use std::ops::Range;

use super::arguments::{Address, Forward, Receive};
use super::error::CudaError;
use super::network::{CudaNetwork, View};
use super::room::{FrameRoom, Saved};

/// Edge states as a message layer reads them.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgeState {
    pub at: Address,
    /// LayerNorm whose scale and shift have yet to be applied; -1 for none.
    pub norm: i32,
}

impl CudaNetwork {
    /// Encodes nodes and edges of frames.
    pub(super) fn encode(&self, frames: &[(usize, &View)]) -> Result<(), CudaError> {
        let nodes: Vec<_> = frames.iter().map(|(k, view)| self.node_encoder(*k, view)).collect();
        self.kernels.forward(&nodes, self.nodes())?;
        let edges: Vec<_> = frames.iter().map(|(k, view)| self.edge_encoder(*k, view)).collect();
        self.kernels.forward(&edges, self.edges())
    }

    fn node_encoder(&self, frame: usize, view: &View) -> Forward {
        let mlp = if frame == 0 { self.layout.node_first } else { self.layout.node_later };
        let room = &self.room.frames[frame];
        let item = Forward {
            features: view.node.at,
            feature_stride: view.node.stride as i32,
            count: view.nodes,
            output: room.node,
            ..self.mlp(mlp)
        };
        item.saving(&room.node_encoder)
    }

    fn edge_encoder(&self, frame: usize, view: &View) -> Forward {
        let mlp = if frame == 0 { self.layout.edge_first } else { self.layout.edge_later };
        let room = &self.room.frames[frame];
        let item = Forward { output: room.edge, ..self.mlp(mlp) };
        item.reading_edges(view).saving(&room.edge_encoder)
    }

    /// The encoded edges of a frame.
    pub(super) fn encoded_edges(&self, frame: usize) -> EdgeState {
        let room = &self.room.frames[frame];
        if room.edge != 0 {
            return EdgeState { at: room.edge, norm: -1 };
        }
        let mlp = if frame == 0 { self.layout.edge_first } else { self.layout.edge_later };
        EdgeState { at: room.edge_encoder.normal, norm: self.layout.mlps[mlp].scale() as i32 }
    }

    /// The messages of a layer as edge states.
    pub(super) fn messages(&self, layer: usize) -> EdgeState {
        let room = &self.room.layers[layer];
        if room.edge != 0 {
            return EdgeState { at: room.edge, norm: -1 };
        }
        let mlp = &self.layout.mlps[self.layout.layers[layer].message];
        EdgeState { at: room.message.normal, norm: mlp.scale() as i32 }
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
    pub(super) fn node_state(&self, layer: usize) -> Address {
        if layer == 0 {
            self.room.frames[0].node
        } else if layer < self.layout.frames {
            self.room.frames[layer].fused
        } else {
            self.room.layers[layer - 1].node
        }
    }

    /// The network on a window, the oldest frame first; `keep`: before its gradients.
    pub(super) fn pass(&self, views: &[View], keep: bool) -> Result<(), CudaError> {
        self.kernels.begin(keep);
        let training = self.room.training.is_some();
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

    pub(super) fn decode(&self, view: &View) -> Result<(), CudaError> {
        let last = self.layout.layers.len() - 1;
        let decoder = Forward {
            x: [self.room.layers[last].node, 0],
            count: view.nodes,
            narrow: self.address(&self.output),
            ..self.mlp(self.layout.decoder)
        };
        self.kernels.forward(&[decoder.saving(&self.room.decoder)], self.nodes())
    }

    /// S joins the node states of the previous frame with the encoded nodes; `edgemsg` the previous
    /// frame's messages with the features of edges that both frames have. For the layers of one
    /// frame, or of several that all have the same graph.
    pub(super) fn fuse(
        &self,
        frames: Range<usize>,
        before: &View,
        view: &View,
    ) -> Result<(), CudaError> {
        let nodes = frames.clone().map(|frame| {
            let room = &self.room.frames[frame];
            let item = Forward {
                x: [self.room.layers[frame - 1].node, room.node],
                count: view.nodes,
                output: room.fused,
                ..self.mlp(self.layout.node_fusion)
            };
            item.saving(&room.node_fusion)
        });
        self.kernels.forward(&nodes.collect::<Vec<_>>(), self.nodes())?;
        let Some(fusion) = self.layout.edge_fusion else { return Ok(()) };

        let graph = |v: &View| ([v.edges, v.sender, v.receiver], [v.start, v.sender]);
        let FrameRoom { previous, next, .. } = self.room.frames[frames.start];
        self.kernels.same_edges(graph(view).0, graph(before).1, previous)?;
        if next != 0 {
            self.kernels.same_edges(graph(before).0, graph(view).1, next)?;
        }
        let edges = frames.map(|frame| {
            let room = &self.room.frames[frame];
            let messages = self.messages(frame - 1);
            let item = Forward {
                x: [messages.at, 0],
                input_norm: messages.norm,
                index: room.previous,
                output: room.edge,
                ..self.mlp(fusion)
            };
            item.reading_edges(view).saving(&room.edge_fusion)
        });
        self.kernels.forward(&edges.collect::<Vec<_>>(), self.edges())
    }

    /// Layers side by side on one graph.
    pub(super) fn message_layers(
        &self,
        layers: Range<usize>,
        view: &View,
    ) -> Result<(), CudaError> {
        let count = view.nodes;
        let each = || layers.clone().map(|k| (k, &self.layout.layers[k], &self.room.layers[k]));

        let parts = each().flat_map(|(layer, mlps, room)| {
            [(mlps.sender, room.sender), (mlps.receiver, room.receiver)].map(|(packed, output)| {
                let state = self.node_state(layer);
                Forward { x: [state, 0], count, output, ..self.linear(packed) }
            })
        });
        self.kernels.forward(&parts.collect::<Vec<_>>(), self.nodes())?;

        let messages = each().map(|(layer, mlps, room)| {
            let edge = self.edge_state(layer);
            let item = Forward {
                x: [edge.at, 0],
                input_norm: edge.norm,
                added: [room.sender, room.receiver],
                added_index: [view.sender, view.receiver],
                count: view.edges,
                output: room.edge,
                residual: if self.layout.residual && room.edge != 0 { edge.at } else { 0 },
                sums: room.sums,
                ..self.mlp(mlps.message)
            };
            item.saving(&room.message)
        });
        self.kernels.forward(&messages.collect::<Vec<_>>(), self.edges())?;

        let receive = each().map(|(_, mlps, room)| {
            let mlp = &self.layout.mlps[mlps.message];
            Receive {
                nodes: view.nodes,
                start: view.start,
                sums: room.sums,
                parameters: self.address(&self.parameters),
                received: room.received,
                norm: mlp.scale() as i32,
                width: mlp.width as i32,
            }
        });
        self.kernels.receive(&receive.collect::<Vec<_>>(), self.nodes())?;

        let updates = each().map(|(layer, mlps, room)| {
            let state = self.node_state(layer);
            let item = Forward {
                x: [state, room.received],
                count,
                output: room.node,
                residual: if self.layout.residual { state } else { 0 },
                ..self.mlp(mlps.update)
            };
            item.saving(&room.update)
        });
        self.kernels.forward(&updates.collect::<Vec<_>>(), self.nodes())
    }
}

impl Forward {
    /// With the features of a frame's edges.
    fn reading_edges(self, view: &View) -> Self {
        Self {
            features: view.edge.at,
            feature_stride: view.edge.stride as i32,
            count: view.edges,
            ..self
        }
    }

    /// With places for what the gradient needs.
    fn saving(self, saved: &Saved) -> Self {
        Self {
            hidden: saved.hidden,
            stride: saved.stride,
            normal: saved.normal,
            deviation: saved.deviation,
            ..self
        }
    }
}
