//! The backward pass: gradients of all linears' outputs, layer by layer from the last. Products
//! with the linears' inputs (`products.rs`) then give those of the weights; in bf16 on Hopper those
//! over edges are computed on the way.

use super::arguments::{Address, Backward};
use super::error::CudaError;
use super::network::{CudaNetwork, View};
use super::products::List;
use super::room::{Passed, Saved};

/// Which buffers hold the gradients that are passed on.
struct Turn<'a> {
    list: &'a List,
    /// The layer whose messages' parts have yet to be added to the gradient of the node states.
    parts: Option<usize>,
    /// Of the node states after a layer,
    node: usize,
    /// and of the messages of a layer, if anything but their sum is used.
    edge: Address,
    messages_used: bool,
    /// The messages' gradient is that of the next frame's edges, by the index from one to the
    /// other, if this is not 0.
    next: Address,
}

impl CudaNetwork {
    /// From the gradient of the output (`passed.output`) to those of all linears' outputs. `meanwhile`
    /// is called once edges are done with.
    pub(super) fn propagate(
        &self,
        views: &[View],
        passed: &Passed,
        list: &List,
        meanwhile: impl FnOnce() -> Result<(), CudaError>,
    ) -> Result<(), CudaError> {
        let decoder = Backward {
            output32: passed.output,
            count: views[0].nodes,
            input32: [passed.node[0], 0],
            ..self.mlp_backward(self.layout.decoder, &self.room.decoder, list)
        };
        self.kernels.backward_nodes(&[decoder], self.nodes())?;
        let mut turn = Turn {
            list,
            parts: None,
            node: 0,
            edge: passed.edge[0],
            messages_used: false,
            next: 0,
        };
        for layer in (0..self.layout.layers.len()).rev() {
            let view = &views[layer.min(views.len() - 1)];
            self.message_layer_backward(layer, view, passed, &mut turn)?;
            if layer < self.layout.frames {
                self.frame_backward(layer, view, passed, &mut turn)?;
            }
        }

        let mut nodes = Vec::new();
        let mut edges = Vec::new();
        for (k, (view, room)) in views.iter().zip(&self.room.frames).enumerate() {
            let (layout, first) = (&self.layout, k == 0);
            let (node, edge) = match k {
                0 => (layout.node_first, layout.edge_first),
                _ => (layout.node_later, layout.edge_later),
            };
            let encoder = Backward {
                output32: if first { passed.node[turn.node] } else { room.node_gradient },
                count: view.nodes,
                ..self.mlp_backward(node, &room.node_encoder, list)
            };
            nodes.push(if first { self.adding_parts(encoder, &mut turn) } else { encoder });
            edges.push(Backward {
                output: if layout.residual { turn.edge } else { room.edge_gradient },
                // Edges that the frame before has too come from the fusion.
                selection: if layout.edge_fusion.is_some() && !first { room.previous } else { 0 },
                select_none: 1,
                count: view.edges,
                ..self.mlp_backward(edge, &room.edge_encoder, list)
            });
        }
        self.kernels.backward_edges(&edges, self.edges())?;
        meanwhile()?;
        self.kernels.backward_nodes(&nodes, self.nodes())
    }

    /// Has an MLP add to the gradient of its output what came from the messages that read it.
    fn adding_parts(&self, item: Backward, turn: &mut Turn) -> Backward {
        let Some(layer) = turn.parts.take() else { return item };
        let room = &self.room.layers[layer];
        Backward {
            parts: [room.sender_gradient, room.receiver_gradient],
            part_weights: self.packed_at(self.layout.layers[layer].to_nodes),
            ..item
        }
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
        // A residual network adds to the gradients where they are.
        let residual = self.layout.residual;
        let after = passed.node[turn.node];
        if !residual {
            turn.node = 1 - turn.node;
        }
        let update = Backward {
            output32: after,
            count: view.nodes,
            input32: [passed.node[turn.node], passed.received],
            accumulate: i32::from(residual),
            ..self.mlp_backward(mlps.update, &room.update, turn.list)
        };
        let update = self.adding_parts(update, turn);
        self.kernels.backward_nodes(&[update], self.nodes())?;

        let output = if turn.messages_used { turn.edge } else { 0 };
        if !residual {
            turn.edge = match self.room.frames.get(layer) {
                Some(frame) => frame.edge_gradient,
                None => passed.other_edge(turn.edge),
            };
        }
        // The forward pass has done with its sums.
        let sums = if self.kernels.fused() { room.sums } else { 0 };
        let message = Backward {
            sums,
            output,
            output_index: turn.next,
            gathered: passed.received,
            gathered_index: view.receiver,
            count: view.edges,
            input: turn.edge,
            accumulate: i32::from(residual && turn.messages_used),
            ..self.mlp_backward(mlps.message, &room.message, turn.list)
        };
        self.kernels.backward_edges(&[message], self.edges())?;
        (turn.messages_used, turn.next) = (true, 0);

        let gradients = [room.sender_gradient, room.receiver_gradient];
        self.kernels.collect(view, self.nodes(), [room.message.linear, sums], gradients)?;
        turn.parts = Some(layer);
        Ok(())
    }

    /// From the gradients of the nodes and edges of a frame to those of the frame before; those of
    /// the encoders wait.
    fn frame_backward(
        &self,
        frame: usize,
        view: &View,
        passed: &Passed,
        turn: &mut Turn,
    ) -> Result<(), CudaError> {
        let room = &self.room.frames[frame];
        if frame == 0 {
            return Ok(());
        }
        turn.messages_used = false;
        if let Some(fusion) = self.layout.edge_fusion {
            let output = turn.edge;
            turn.edge = passed.edge[0];
            let fusion = Backward {
                output,
                selection: room.previous,
                count: view.edges,
                input: turn.edge,
                ..self.mlp_backward(fusion, &room.edge_fusion, turn.list)
            };
            self.kernels.backward_edges(&[fusion], self.edges())?;
            (turn.messages_used, turn.next) = (true, room.next);
        }
        let output32 = passed.node[turn.node];
        turn.node = 1 - turn.node;
        let fusion = Backward {
            output32,
            count: view.nodes,
            input32: [passed.node[turn.node], room.node_gradient],
            ..self.mlp_backward(self.layout.node_fusion, &room.node_fusion, turn.list)
        };
        let fusion = self.adding_parts(fusion, turn);
        self.kernels.backward_nodes(&[fusion], self.nodes())
    }

    /// What backward launches of an MLP have in common.
    fn mlp_backward(&self, mlp: usize, saved: &Saved, list: &List) -> Backward {
        let m = &self.layout.mlps[mlp];
        let (products, product_count) = list.of(saved, &self.kernels.device);
        Backward {
            products,
            product_count: product_count as i32,
            blocks: saved.blocks as i32,
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
