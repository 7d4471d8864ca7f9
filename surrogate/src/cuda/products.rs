//! The products that the gradient of the weights consists of: a linear's input with the gradient of
//! its output, for each application of an MLP.

use gpu::{ConstPointer, Pointer};

use super::activations::MlpActivations;
use super::forward_pass::EdgeState;
use super::network::{CudaNetwork, FeatureRows, FrameView};
use super::ops::forward::NO_OFFSET;
use super::ops::gradient::Product;
use super::ops::tile::Stored;

/// Blocks that share the rows of a product over edges, and over nodes.
pub(super) const EDGE_BLOCKS: usize = 44;
pub(super) const NODE_BLOCKS: usize = 8;

/// A product without a place for its sums, and the part of the weights whose gradient it is a part of.
pub(super) struct Part {
    /// MLP, its linear and, of the first linear, input.
    pub mlp: usize,
    pub linear: usize,
    pub input: usize,
    /// Offset of the LayerNorm whose scale and shift the product leaves out, or [`NO_OFFSET`].
    pub norm: i32,
    /// The application of an MLP to edges, by the gradients of its linears' outputs; none over nodes.
    pub application: Option<Pointer<Stored>>,
    /// The product gives the gradient of the bias too.
    pub has_bias: bool,
    pub product: Product,
}

/// What an application of an MLP read.
struct Application<'a> {
    mlp: usize,
    saved: &'a MlpActivations,
    /// Whether its rows are edges, and their number on the device.
    edges: bool,
    count: ConstPointer<u32>,
    states: Vec<EdgeState>,
    /// Row k of the first state is row `index[k]`, if not null.
    index: ConstPointer<u32>,
    features: Option<FeatureRows>,
}

impl CudaNetwork {
    /// All products of a training step; without views, with null pointers to what belongs to frames.
    pub(super) fn parts(&self, views: &[FrameView]) -> Vec<Part> {
        let view = |k: usize| {
            let view = views.get(k.min(self.layout.frames - 1));
            view.copied().unwrap_or_default()
        };
        let mut parts = Vec::new();
        for k in 0..self.layout.frames {
            self.add_frame(&mut parts, k, &view(k));
        }
        for k in 0..self.layout.layers.len() {
            self.add_layer(&mut parts, k, &view(k));
        }
        let last = self.activations.layers[self.layout.layers.len() - 1].node;
        let (mlp, saved) = (self.layout.decoder, &self.activations.decoder);
        self.add_products(&mut parts, &of_nodes(mlp, saved, vec![last], None, &view(0)));
        parts
    }

    /// Encoders and fusions of a frame.
    fn add_frame(&self, parts: &mut Vec<Part>, k: usize, view: &FrameView) {
        let (layout, frame) = (&self.layout, &self.activations.frames[k]);
        let (node, edge) = layout.encoders(k);
        let features = Some(view.node_features);
        self.add_products(parts, &of_nodes(node, &frame.node_encoder, vec![], features, view));
        let edges = |mlp, saved, states, index| Application {
            mlp,
            saved,
            edges: true,
            count: view.edges,
            states,
            index,
            features: Some(view.edge_features),
        };
        self.add_products(parts, &edges(edge, &frame.edge_encoder, vec![], ConstPointer::NULL));
        if k == 0 {
            return;
        }
        let states = vec![self.activations.layers[k - 1].node, frame.node];
        let (mlp, saved) = (layout.node_fusion, &frame.node_fusion);
        self.add_products(parts, &of_nodes(mlp, saved, states, None, view));
        if let Some(fusion) = layout.edge_fusion {
            let (states, index) = (vec![self.messages(k - 1)], frame.previous.into());
            self.add_products(parts, &edges(fusion, &frame.edge_fusion, states, index));
        }
    }

    /// Messages and updates of a layer.
    fn add_layer(&self, parts: &mut Vec<Part>, k: usize, view: &FrameView) {
        let (mlps, layer) = (&self.layout.layers[k], &self.activations.layers[k]);
        let state = self.node_state(k);
        self.add_products(
            parts,
            &Application {
                mlp: mlps.message,
                saved: &layer.message,
                edges: true,
                count: view.edges,
                states: vec![self.edge_state(k)],
                index: ConstPointer::NULL,
                features: None,
            },
        );
        for (input, dz) in [layer.sender_gradient, layer.receiver_gradient].into_iter().enumerate()
        {
            parts.push(Part {
                mlp: mlps.message,
                linear: 0,
                input,
                norm: NO_OFFSET,
                application: None,
                has_bias: false,
                product: Product {
                    x: state.into(),
                    dz: dz.into(),
                    count: view.nodes,
                    blocks: NODE_BLOCKS as i32,
                    ..Product::default()
                },
            });
        }
        let states = vec![state, layer.received];
        self.add_products(parts, &of_nodes(mlps.update, &layer.update, states, None, view));
    }

    /// The products of one application of an MLP, those of the last linear first.
    fn add_products(&self, parts: &mut Vec<Part>, application: &Application) {
        let &Application { mlp, saved, edges, count, index, features, .. } = application;
        let m = &self.layout.mlps[mlp];
        let blocks = match (edges, self.kernels.fused()) {
            (false, _) => NODE_BLOCKS,
            (true, false) => EDGE_BLOCKS,
            (true, true) => saved.blocks,
        };
        let common = Product { count, blocks: blocks as i32, ..Product::default() };
        let part = |linear, input, norm, has_bias, product| Part {
            mlp,
            linear,
            input,
            norm,
            application: edges.then_some(saved.linear_gradients),
            has_bias,
            product,
        };
        for linear in (1..=m.layers).rev() {
            let product = Product {
                x: self.stored(saved.hidden, (linear - 1) * saved.stride).into(),
                dz: self.stored(saved.linear_gradients, linear * saved.stride).into(),
                ..common
            };
            parts.push(part(linear, 0, NO_OFFSET, true, product));
        }
        let dz = saved.linear_gradients.into();
        // The nodes' parts of messages are apart.
        let first = m.inputs.len() - application.states.len() - usize::from(features.is_some());
        for (k, state) in application.states.iter().enumerate() {
            let product = Product {
                x: state.states.into(),
                index: if k == 0 { index } else { ConstPointer::NULL },
                dz,
                ..common
            };
            parts.push(part(0, first + k, state.norm, k == 0, product));
        }
        if let Some(features) = features {
            let product = Product {
                features: features.values,
                feature_count: features.stride as i32,
                dz,
                ..common
            };
            let k = application.states.len();
            parts.push(part(0, first + k, NO_OFFSET, k == 0, product));
        }
    }

    /// The stored number `count` numbers further on.
    fn stored(&self, pointer: Pointer<Stored>, count: usize) -> Pointer<Stored> {
        let bytes = self.kernels.launcher.precision.stored_bytes() * count;
        pointer.cast::<u8>().offset(bytes).cast()
    }
}

/// An application of an MLP to the nodes of a frame.
fn of_nodes<'a>(
    mlp: usize,
    saved: &'a MlpActivations,
    states: Vec<Pointer<Stored>>,
    features: Option<FeatureRows>,
    view: &FrameView,
) -> Application<'a> {
    let plain = |states| EdgeState { states, norm: NO_OFFSET };
    Application {
        mlp,
        saved,
        edges: false,
        count: view.nodes,
        states: states.into_iter().map(plain).collect(),
        index: ConstPointer::NULL,
        features,
    }
}
