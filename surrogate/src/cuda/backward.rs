//! The backward pass: gradients of all linears' outputs, layer by layer from the last. Products
//! with the linears' inputs (`products.rs`) then give those of the weights.

use super::error::CudaError;
use super::kernels::{Address, Backward, Forward};
use super::network::{CudaNetwork, View};
use super::room::{Passed, Saved};

/// Which buffers hold the gradients that are passed on.
struct Turn {
    /// Of the node states after a layer,
    node: usize,
    /// and of the messages of a layer, if anything but their sum is used.
    edge: usize,
    messages_used: bool,
    /// The messages' gradient is that of the next frame's edges, by the index from one to the
    /// other, if this is not 0.
    next: Address,
}

impl CudaNetwork {
    /// From the gradient of the output (`passed.output`) to those of all linears' outputs.
    pub(super) fn propagate(&self, views: &[View], passed: &Passed) -> Result<(), CudaError> {
        let capacity = self.room.capacity;
        let decoder = Backward {
            output32: passed.output,
            rows: views[0].points as u32,
            input32: [passed.node[0], 0],
            ..self.mlp_backward(self.layout.decoder, &self.room.decoder)
        };
        self.kernels.backward(&[decoder], capacity.points)?;

        let mut turn = Turn { node: 0, edge: 0, messages_used: false, next: 0 };
        for layer in (0..self.layout.layers.len()).rev() {
            let view = &views[layer.min(views.len() - 1)];
            self.message_layer_backward(layer, view, passed, &mut turn)?;
            if layer < self.layout.frames {
                self.frame_backward(layer, view, passed, &mut turn)?;
            }
        }

        let nodes: Vec<Backward> = views
            .iter()
            .enumerate()
            .map(|(k, view)| {
                let mlp = if k == 0 { self.layout.node_first } else { self.layout.node_later };
                let room = &self.room.frames[k];
                let last = if k == 0 { passed.node[turn.node] } else { room.node_gradient };
                Backward {
                    output32: last,
                    rows: view.points as u32,
                    ..self.mlp_backward(mlp, &room.node_encoder)
                }
            })
            .collect();
        self.kernels.backward(&nodes, capacity.points)
    }

    /// From the gradients of a layer's node states and messages to those of what it reads.
    fn message_layer_backward(
        &self,
        layer: usize,
        view: &View,
        passed: &Passed,
        turn: &mut Turn,
    ) -> Result<(), CudaError> {
        let (mlps, room) = (&self.layout.layers[layer], &self.room.layers[layer]);
        let (points, edges) = (self.room.capacity.points, self.room.capacity.edges);
        let rows = view.points as u32;
        // A residual network adds to the gradients where they are.
        let residual = self.layout.residual;
        let after = passed.node[turn.node];
        if !residual {
            turn.node = 1 - turn.node;
        }
        let before = passed.node[turn.node];
        let update = Backward {
            output32: after,
            rows,
            input32: [before, passed.received],
            accumulate: i32::from(residual),
            ..self.mlp_backward(mlps.update, &room.update)
        };
        self.kernels.backward(&[update], points)?;

        let output = if turn.messages_used { passed.edge[turn.edge] } else { 0 };
        if !residual {
            turn.edge = 1 - turn.edge;
        }
        let message = Backward {
            output,
            output_index: turn.next,
            gathered: passed.received,
            gathered_index: view.receiver,
            count: view.edges,
            input: passed.edge[turn.edge],
            accumulate: i32::from(residual && turn.messages_used),
            ..self.mlp_backward(mlps.message, &room.message)
        };
        self.kernels.backward(&[message], edges)?;
        (turn.messages_used, turn.next) = (true, 0);

        let (sent, received) = (room.sender_gradient, room.receiver_gradient);
        let first = room.message.linear;
        self.kernels.collect(view.start, view.reverse, view.points, first, sent, received)?;
        let nodes = Forward {
            x: [sent, received],
            rows,
            output32: before,
            accumulate: 1,
            ..self.linear(mlps.to_nodes)
        };
        self.kernels.forward(&[nodes], points)
    }

    /// From the gradients of the nodes and edges of a frame to those of its encoders and of the
    /// frame before.
    fn frame_backward(
        &self,
        frame: usize,
        view: &View,
        passed: &Passed,
        turn: &mut Turn,
    ) -> Result<(), CudaError> {
        let room = &self.room.frames[frame];
        let (points, edges) = (self.room.capacity.points, self.room.capacity.edges);
        let first = frame == 0;
        let encoder = if first { self.layout.edge_first } else { self.layout.edge_later };
        let fusion = self.layout.edge_fusion.filter(|_| !first);
        let encoder = Backward {
            output: passed.edge[turn.edge],
            selection: if fusion.is_some() { room.previous } else { 0 },
            select_none: 1,
            count: view.edges,
            ..self.mlp_backward(encoder, &room.edge_encoder)
        };
        self.kernels.backward(&[encoder], edges)?;
        turn.messages_used = false;
        if let Some(fusion) = fusion {
            let output = passed.edge[turn.edge];
            turn.edge = 1 - turn.edge;
            let fusion = Backward {
                output,
                selection: room.previous,
                count: view.edges,
                input: passed.edge[turn.edge],
                ..self.mlp_backward(fusion, &room.edge_fusion)
            };
            self.kernels.backward(&[fusion], edges)?;
            (turn.messages_used, turn.next) = (true, room.next);
        }
        if first {
            return Ok(());
        }
        let output32 = passed.node[turn.node];
        turn.node = 1 - turn.node;
        let fusion = Backward {
            output32,
            rows: view.points as u32,
            input32: [passed.node[turn.node], room.node_gradient],
            ..self.mlp_backward(self.layout.node_fusion, &room.node_fusion)
        };
        self.kernels.backward(&[fusion], points)
    }

    /// What backward launches of an MLP have in common.
    fn mlp_backward(&self, mlp: usize, saved: &Saved) -> Backward {
        let m = &self.layout.mlps[mlp];
        Backward {
            hidden: saved.hidden,
            linear: saved.linear,
            stride: saved.stride,
            normal: saved.normal,
            deviation: saved.deviation,
            norm_sums: saved.norm_sums,
            weights: self.packed_at(m.backward),
            units: m.backward.words as i32,
            parameters: self.address(&self.parameters),
            norm: if m.norm { m.scale() as i32 } else { -1 },
            layers: m.layers as i32,
            width: m.width as i32,
            slope: self.layout.slope,
            ..Backward::default()
        }
    }
}
