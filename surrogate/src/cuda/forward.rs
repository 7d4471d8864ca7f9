//! The forward pass: as `crate::model`.

use super::error::CudaError;
use super::kernels::{Address, Forward};
use super::network::{CudaNetwork, View};
use super::room::Saved;

/// Edge states as a message layer reads them.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgeState {
    pub at: Address,
    /// LayerNorm whose scale and shift have yet to be applied; -1 for none.
    pub norm: i32,
}

impl CudaNetwork {
    /// Encodes nodes and edges of all frames.
    pub(super) fn encode(&self, views: &[View]) -> Result<(), CudaError> {
        let nodes: Vec<_> =
            views.iter().enumerate().map(|(k, v)| self.node_encoder(k, v)).collect();
        self.kernels.forward(&nodes, self.room.capacity.points)?;
        let edges: Vec<_> =
            views.iter().enumerate().map(|(k, v)| self.edge_encoder(k, v)).collect();
        self.kernels.forward(&edges, self.room.capacity.edges)
    }

    pub(super) fn node_encoder(&self, frame: usize, view: &View) -> Forward {
        let mlp = if frame == 0 { self.layout.node_first } else { self.layout.node_later };
        let room = &self.room.frames[frame];
        let item = Forward {
            features: view.node.at,
            feature_stride: view.node.stride as i32,
            rows: view.points as u32,
            output: room.node,
            ..self.mlp(mlp)
        };
        item.saving(&room.node_encoder)
    }

    pub(super) fn edge_encoder(&self, frame: usize, view: &View) -> Forward {
        let mlp = if frame == 0 { self.layout.edge_first } else { self.layout.edge_later };
        let room = &self.room.frames[frame];
        let item = Forward {
            features: view.edge.at,
            feature_stride: view.edge.stride as i32,
            count: view.edges,
            output: room.edge,
            ..self.mlp(mlp)
        };
        item.saving(&room.edge_encoder)
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

    /// All layers and the decoder, given the encoded frames.
    pub(super) fn pass_messages(&self, views: &[View]) -> Result<(), CudaError> {
        for layer in 0..self.layout.layers.len() {
            if layer > 0 && layer < self.layout.frames {
                self.next_frame(layer, &views[layer - 1], &views[layer])?;
            }
            self.message_layer(layer, &views[layer.min(views.len() - 1)])?;
        }
        let last = self.layout.layers.len() - 1;
        let decoder = Forward {
            x: [self.room.layers[last].node, 0],
            rows: views[0].points as u32,
            narrow: self.address(&self.output),
            ..self.mlp(self.layout.decoder)
        };
        self.kernels.forward(&[decoder.saving(&self.room.decoder)], self.room.capacity.points)
    }

    /// S joins the node state of the previous frame with the encoded nodes; `edgemsg` the previous
    /// frame's messages with the features of edges that both frames have.
    fn next_frame(&self, frame: usize, before: &View, view: &View) -> Result<(), CudaError> {
        let room = &self.room.frames[frame];
        let item = Forward {
            x: [self.room.layers[frame - 1].node, room.node],
            rows: view.points as u32,
            output: room.fused,
            ..self.mlp(self.layout.node_fusion)
        };
        self.kernels.forward(&[item.saving(&room.node_fusion)], self.room.capacity.points)?;
        let Some(fusion) = self.layout.edge_fusion else { return Ok(()) };

        let graph = |v: &View| ([v.edges, v.sender, v.receiver], [v.start, v.sender]);
        self.kernels.same_edges(graph(view).0, graph(before).1, room.previous)?;
        if self.room.training.is_some() {
            self.kernels.same_edges(graph(before).0, graph(view).1, room.next)?;
        }
        let messages = self.messages(frame - 1);
        let item = Forward {
            x: [messages.at, 0],
            input_norm: messages.norm,
            index: room.previous,
            features: view.edge.at,
            feature_stride: view.edge.stride as i32,
            count: view.edges,
            output: room.edge,
            ..self.mlp(fusion)
        };
        self.kernels.forward(&[item.saving(&room.edge_fusion)], self.room.capacity.edges)
    }

    fn message_layer(&self, layer: usize, view: &View) -> Result<(), CudaError> {
        let (mlps, room) = (&self.layout.layers[layer], &self.room.layers[layer]);
        let (state, edge) = (self.node_state(layer), self.edge_state(layer));
        let points = self.room.capacity.points;
        let rows = view.points as u32;
        let part = |packed, output| Forward { x: [state, 0], rows, output, ..self.linear(packed) };
        let parts = [part(mlps.sender, room.sender), part(mlps.receiver, room.receiver)];
        self.kernels.forward(&parts, points)?;

        let message = Forward {
            x: [edge.at, 0],
            input_norm: edge.norm,
            added: [room.sender, room.receiver],
            added_index: [view.sender, view.receiver],
            count: view.edges,
            output: room.edge,
            residual: if self.layout.residual && room.edge != 0 { edge.at } else { 0 },
            ..self.mlp(mlps.message)
        };
        self.kernels.forward(&[message.saving(&room.message)], self.room.capacity.edges)?;

        let mlp = &self.layout.mlps[mlps.message];
        self.kernels.receive(
            view.start,
            view.points,
            room.message.normal,
            self.address(&self.parameters),
            mlp.scale() as i32,
            mlp.width,
            room.received,
        )?;
        let update = Forward {
            x: [state, room.received],
            rows,
            output: room.node,
            residual: if self.layout.residual { state } else { 0 },
            ..self.mlp(mlps.update)
        };
        self.kernels.forward(&[update.saving(&room.update)], points)
    }
}

impl Forward {
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
