//! The backward pass: gradients of all linears' outputs, layer by layer from the last. Products with
//! the linears' inputs (`weight_gradient.rs`) then give those of the weights; in bfloat16 on Hopper
//! those over edges are computed on the way.

use gpu::{ConstPointer, Pointer};

use super::activations::{MlpActivations, StateGradients};
use super::error::CudaError;
use super::network::{CudaNetwork, FrameView};
use super::ops::backward::Backward;
use super::ops::forward::NO_OFFSET;
use super::ops::segment::Collect;
use super::ops::tile::Stored;
use super::weight_gradient::Products;

/// Where the gradients are that a layer hands to the one before it.
struct Handover<'a> {
    products: &'a Products,
    /// The layer of which the senders' and receivers' parts of messages have yet to be added to the
    /// gradient of the node states that it read.
    parts: Option<usize>,
    /// Which of the two buffers holds the gradient of the node states.
    node: usize,
    /// The gradient of the messages of a layer,
    edge: Pointer<Stored>,
    /// if anything but their sum is used.
    messages_used: bool,
    /// If not null, the messages' gradient is that of the next frame's edges, by the index from one to
    /// the other.
    next: Pointer<u32>,
}

impl CudaNetwork {
    /// From the gradient of the output (`gradients.output`) to those of all linears' outputs.
    /// `after_edges` is called once all edges are done with.
    pub(super) fn backward_pass(
        &self,
        views: &[FrameView],
        gradients: &StateGradients,
        products: &Products,
        after_edges: impl FnOnce() -> Result<(), CudaError>,
    ) -> Result<(), CudaError> {
        let decoder = Backward {
            output32: gradients.output,
            count: views[0].nodes,
            input32: [gradients.node[0], Pointer::NULL],
            ..self.mlp_backward(self.layout.decoder, &self.activations.decoder, products)
        };
        self.kernels.backward_nodes(&[decoder], self.nodes())?;
        let mut handover = Handover {
            products,
            parts: None,
            node: 0,
            edge: gradients.edge[0],
            messages_used: false,
            next: Pointer::NULL,
        };
        for layer in (0..self.layout.layers.len()).rev() {
            let view = &views[layer.min(views.len() - 1)];
            self.message_layer_backward(layer, view, gradients, &mut handover)?;
            if 0 < layer && layer < self.layout.frames {
                self.fusion_backward(layer, view, gradients, &mut handover)?;
            }
        }
        self.encoders_backward(views, gradients, &mut handover, after_edges)
    }

    /// The encoders of all frames.
    fn encoders_backward(
        &self,
        views: &[FrameView],
        gradients: &StateGradients,
        handover: &mut Handover,
        after_edges: impl FnOnce() -> Result<(), CudaError>,
    ) -> Result<(), CudaError> {
        let (layout, products) = (&self.layout, handover.products);
        let mut nodes = Vec::new();
        let mut edges = Vec::new();
        for (k, (view, frame)) in views.iter().zip(&self.activations.frames).enumerate() {
            let first = k == 0;
            let (node, edge) = layout.encoders(k);
            let encoder = Backward {
                output32: if first { gradients.node[handover.node] } else { frame.node_gradient },
                count: view.nodes,
                ..self.mlp_backward(node, &frame.node_encoder, products)
            };
            nodes.push(if first { self.adding_parts(encoder, handover) } else { encoder });
            // Edges that the frame before has too come from the fusion.
            let selected = layout.edge_fusion.is_some() && !first;
            edges.push(Backward {
                output: if layout.residual { handover.edge } else { frame.edge_gradient }.into(),
                selection: if selected { frame.previous.into() } else { ConstPointer::NULL },
                select_none: 1,
                count: view.edges,
                ..self.mlp_backward(edge, &frame.edge_encoder, products)
            });
        }
        self.kernels.backward_edges(&edges, self.edges())?;
        after_edges()?;
        self.kernels.backward_nodes(&nodes, self.nodes())
    }

    /// Has an MLP add to the gradient of its output what came from the messages that read it.
    fn adding_parts(&self, item: Backward, handover: &mut Handover) -> Backward {
        let Some(layer) = handover.parts.take() else { return item };
        let activations = &self.activations.layers[layer];
        Backward {
            parts: [activations.sender_gradient.into(), activations.receiver_gradient.into()],
            part_weights: self.packed(self.layout.layers[layer].to_nodes),
            ..item
        }
    }

    /// From the gradients of a layer's node states and messages to those of what it reads.
    fn message_layer_backward(
        &self,
        layer: usize,
        view: &FrameView,
        gradients: &StateGradients,
        handover: &mut Handover,
    ) -> Result<(), CudaError> {
        let (mlps, activations) = (&self.layout.layers[layer], &self.activations.layers[layer]);
        // Layers that add to the states add to their gradients where they are.
        let residual = self.layout.residual;
        let adds = self.layout.adds_to_nodes(layer);
        let after = gradients.node[handover.node];
        if !adds {
            handover.node = 1 - handover.node;
        }
        let update = Backward {
            output32: after,
            count: view.nodes,
            input32: [gradients.node[handover.node], gradients.received],
            accumulate: i32::from(adds),
            ..self.mlp_backward(mlps.update, &activations.update, handover.products)
        };
        let update = self.adding_parts(update, handover);
        self.kernels.backward_nodes(&[update], self.nodes())?;

        let output = if handover.messages_used { handover.edge } else { Pointer::NULL };
        if !residual {
            handover.edge = match self.activations.frames.get(layer) {
                Some(frame) => frame.edge_gradient,
                None => gradients.other_edge(handover.edge),
            };
        }
        // The forward pass has done with its sums.
        let sums = if self.kernels.fused() { activations.sums } else { Pointer::NULL };
        let message = Backward {
            sums,
            output: output.into(),
            output_index: handover.next.into(),
            gathered: gradients.received.into(),
            gathered_index: view.receiver,
            count: view.edges,
            input: handover.edge,
            accumulate: i32::from(residual && handover.messages_used),
            ..self.mlp_backward(mlps.message, &activations.message, handover.products)
        };
        self.kernels.backward_edges(&[message], self.edges())?;
        (handover.messages_used, handover.next) = (true, Pointer::NULL);

        let parts = Collect {
            start: view.start,
            reverse: view.reverse,
            count: view.nodes,
            x: activations.message.linear_gradients.into(),
            sums: sums.into(),
            sent: activations.sender_gradient,
            received: activations.receiver_gradient,
        };
        self.kernels.segment.collect(&parts, self.nodes())?;
        handover.parts = Some(layer);
        Ok(())
    }

    /// From the gradients of the nodes and edges of a frame, not the first, to those of the frame
    /// before; those of the encoders wait.
    fn fusion_backward(
        &self,
        frame: usize,
        view: &FrameView,
        gradients: &StateGradients,
        handover: &mut Handover,
    ) -> Result<(), CudaError> {
        let activations = &self.activations.frames[frame];
        handover.messages_used = false;
        if let Some(fusion) = self.layout.edge_fusion {
            let output = handover.edge;
            handover.edge = gradients.edge[0];
            let fusion = Backward {
                output: output.into(),
                selection: activations.previous.into(),
                count: view.edges,
                input: handover.edge,
                ..self.mlp_backward(fusion, &activations.edge_fusion, handover.products)
            };
            self.kernels.backward_edges(&[fusion], self.edges())?;
            (handover.messages_used, handover.next) = (true, activations.next);
        }
        let output32 = gradients.node[handover.node];
        handover.node = 1 - handover.node;
        let (mlp, saved) = (self.layout.node_fusion, &activations.node_fusion);
        let fusion = Backward {
            output32,
            count: view.nodes,
            input32: [gradients.node[handover.node], activations.node_gradient],
            ..self.mlp_backward(mlp, saved, handover.products)
        };
        let fusion = self.adding_parts(fusion, handover);
        self.kernels.backward_nodes(&[fusion], self.nodes())
    }

    /// What backward launches of an MLP have in common.
    fn mlp_backward(&self, mlp: usize, saved: &MlpActivations, products: &Products) -> Backward {
        let m = &self.layout.mlps[mlp];
        let (products, product_count) = products.of(saved, self.device());
        Backward {
            products,
            product_count: product_count as i32,
            blocks: saved.blocks as i32,
            hidden: saved.hidden.into(),
            linear: saved.linear_gradients,
            stride: saved.stride as u64,
            normal: saved.normal.into(),
            deviation: saved.deviation.into(),
            norm_sums: saved.norm_sums,
            weights: self.packed(m.backward),
            units: m.backward.words as i32,
            parameters: self.pointer(&self.parameters),
            norm: if m.norm { m.scale() as i32 } else { NO_OFFSET },
            layers: m.layers as i32,
            width: m.width as i32,
            slope: self.layout.slope,
            ..Backward::default()
        }
    }
}
