//! Places of each MLP's weights in the list of all [weights](crate::network::parameters::weights), and
//! of the packed weights that the kernels read.

use super::ops::tile::MATRIX_WORDS;
use super::ops::weights::Pack;
use crate::network::{ModelConfig, ModelKind, Precision};

/// What the first linear of an MLP reads, side by side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// States, `width` columns.
    State,
    /// Raw features.
    Features(usize),
}

/// Packed matrices, one after the other.
#[derive(Clone, Copy, Debug, Default)]
pub struct Packed {
    /// First [`Word`](super::ops::tile::Word),
    pub first: usize,
    /// and number of words.
    pub words: usize,
}

/// One MLP.
#[derive(Clone, Debug)]
pub struct Mlp {
    /// Offset of its first weight.
    pub offset: usize,
    pub inputs: Vec<Input>,
    pub width: usize,
    /// Hidden layers.
    pub layers: usize,
    /// Outputs.
    pub columns: usize,
    /// LayerNorm at the end.
    pub norm: bool,
    /// Packed for the forward and for the backward pass.
    pub forward: Packed,
    pub backward: Packed,
}

impl Mlp {
    fn columns_of(&self, input: Input) -> usize {
        match input {
            Input::State => self.width,
            Input::Features(count) => count,
        }
    }

    /// First row of an input in the first linear's matrix.
    pub fn first_row(&self, input: usize) -> usize {
        self.inputs[..input].iter().map(|&i| self.columns_of(i)).sum()
    }

    fn rows(&self) -> usize {
        self.first_row(self.inputs.len())
    }

    /// Outputs of linear `layer`, of which there is one more than hidden layers.
    pub fn outputs(&self, layer: usize) -> usize {
        if layer == self.layers { self.columns } else { self.width }
    }

    /// Offset of the matrix (inputs x outputs) of linear `layer`.
    pub fn weight(&self, layer: usize) -> usize {
        if layer == 0 { self.offset } else { self.bias(layer - 1) + self.outputs(layer - 1) }
    }

    /// Offset of the bias of linear `layer`.
    pub fn bias(&self, layer: usize) -> usize {
        let rows = if layer == 0 { self.rows() } else { self.width };
        self.weight(layer) + rows * self.outputs(layer)
    }

    /// Offset of LayerNorm's scale; its shift follows.
    pub fn scale(&self) -> usize {
        self.bias(self.layers) + self.columns
    }

    fn end(&self) -> usize {
        self.scale() + if self.norm { 2 * self.columns } else { 0 }
    }

    /// Steps of 16 columns that the features take.
    pub fn feature_steps(&self) -> usize {
        self.features().div_ceil(STEP_ROWS)
    }

    /// Number of features among the inputs.
    pub fn features(&self) -> usize {
        self.inputs.iter().map(|i| if let Input::Features(n) = i { *n } else { 0 }).sum()
    }
}

/// One message-passing layer. The first linear of the message MLP acts on [sender, receiver, edge]
/// as W_w h_w + W_v h_v + W_e e, of which the first two are computed for each node: as MLPs of
/// their own without hidden layers.
#[derive(Clone, Debug)]
pub struct MessageLayer {
    /// The MLP of the messages, and that of the node states.
    pub message: usize,
    pub update: usize,
    /// W_w and W_v.
    pub sender: Packed,
    pub receiver: Packed,
    /// Both transposed.
    pub to_nodes: Packed,
}

/// All MLPs of a network, by their numbers in `mlps`. The GNS is a TGNNS of one frame whose layers
/// add to the states.
#[derive(Clone, Debug)]
pub struct Layout {
    /// In the order of their weights.
    pub mlps: Vec<Mlp>,
    /// Encoders of nodes and edges, of the first frame and of later ones.
    pub node_first: usize,
    pub node_later: usize,
    pub edge_first: usize,
    pub edge_later: usize,
    /// Joins the node states of a frame with those of the frame before; the same of edges.
    pub node_fusion: usize,
    pub edge_fusion: Option<usize>,
    /// The layers of the frames, then the further ones.
    pub layers: Vec<MessageLayer>,
    /// The MLP whose output are accelerations.
    pub decoder: usize,
    /// Frames that the network reads.
    pub frames: usize,
    /// Layers add to node and edge states (the GNS).
    pub residual: bool,
    /// The first layer that adds to node states, as all later ones do.
    first_residual: usize,
    /// Slope of LeakyReLU for negative arguments.
    pub slope: f32,
    /// Columns of the decoder's output.
    pub dimensions: usize,
    /// Number of weights.
    pub parameters: usize,
    /// All matrices to pack.
    pub packs: Vec<Pack>,
    /// Words of 16 bytes of all packed weights.
    pub words: usize,
}

impl Layout {
    /// The layout of a network. `fused`: with the weights of edges' MLPs as `edges_backward` reads
    /// them.
    pub fn new(config: &ModelConfig, precision: Precision, fused: bool) -> Self {
        let mut list = MlpList { config, mlps: Vec::new(), parameters: 0 };
        let features = |n| vec![Input::Features(n)];
        let states = |n| vec![Input::State; n];
        let tgnns = config.kind == ModelKind::Tgnns;
        let (node_first, node_later, edge_first, edge_later, node_fusion);
        let mut edge_fusion = None;
        let layers;
        if tgnns {
            node_first = list.add(features(config.first_node_features()));
            node_later = list.add(features(config.later_node_features()));
            edge_first = list.add(features(config.first_edge_features()));
            edge_later = list.add(features(config.later_edge_features()));
            node_fusion = list.add(states(2));
            if config.edge_message {
                let later = Input::Features(config.later_edge_features());
                edge_fusion = Some(list.add(vec![Input::State, later]));
            }
            layers = config.frames + config.message_layers + config.residual_layers;
        } else {
            node_first = list.add(features(config.gns_node_features()));
            edge_first = list.add(features(config.first_edge_features()));
            // One frame has no later ones.
            (node_later, edge_later, node_fusion) = (node_first, edge_first, node_first);
            layers = config.gns_layers;
        }
        let layers: Vec<MessageLayer> = (0..layers)
            .map(|_| MessageLayer {
                message: list.add(states(3)),
                update: list.add(states(2)),
                sender: Packed::default(),
                receiver: Packed::default(),
                to_nodes: Packed::default(),
            })
            .collect();
        let decoder = list.add(states(1));
        list.mlps[decoder].columns = config.dimensions;
        list.mlps[decoder].norm = false;
        let parameters = list.mlps[decoder].end();
        let mut layout = Self {
            node_first,
            node_later,
            edge_first,
            edge_later,
            node_fusion,
            edge_fusion,
            layers,
            decoder,
            frames: if tgnns { config.frames } else { 1 },
            residual: !tgnns,
            first_residual: if tgnns { config.frames + config.message_layers } else { 0 },
            slope: if tgnns { config.leaky_slope as f32 } else { 0.0 },
            dimensions: config.dimensions,
            parameters,
            packs: Vec::new(),
            words: 0,
            mlps: list.mlps,
        };
        layout.pack(precision, fused);
        layout
    }

    /// Numbers of the encoders of nodes and of edges of a frame.
    pub fn encoders(&self, frame: usize) -> (usize, usize) {
        match frame {
            0 => (self.node_first, self.edge_first),
            _ => (self.node_later, self.edge_later),
        }
    }

    /// Whether a layer adds to the node states that it reads.
    pub fn adds_to_nodes(&self, layer: usize) -> bool {
        layer >= self.first_residual
    }

    /// Whether a layer (not the first) reads the messages of the one before.
    pub fn reads_messages(&self, layer: usize) -> bool {
        layer >= self.frames || self.edge_fusion.is_some()
    }

    /// Lays out the packed weights.
    fn pack(&mut self, precision: Precision, fused: bool) {
        let mut packer = Packer { parts: precision.parts(), packs: Vec::new(), words: 0 };
        let messages: Vec<usize> = self.layers.iter().map(|l| l.message).collect();
        let mut edges = vec![self.edge_first, self.edge_later];
        edges.extend(messages.iter().copied().chain(self.edge_fusion));
        for (k, mlp) in self.mlps.iter_mut().enumerate() {
            // Of a message, the first two inputs are the nodes'.
            let first = if messages.contains(&k) { 2 } else { 0 };
            let inputs: Vec<usize> = (first..mlp.inputs.len()).collect();
            mlp.forward = packer.sequence(|p| {
                for &input in &inputs {
                    p.input(mlp, input, Order::Forward);
                }
                for layer in 1..=mlp.layers {
                    p.linear(mlp, layer, Order::Forward);
                }
            });
            let order = if fused && edges.contains(&k) { Order::Plain } else { Order::Transposed };
            mlp.backward = packer.sequence(|p| {
                for layer in (1..=mlp.layers).rev() {
                    p.linear(mlp, layer, order);
                }
                for &input in inputs.iter().filter(|&&i| mlp.inputs[i] == Input::State) {
                    p.input(mlp, input, order);
                }
            });
        }
        for layer in &mut self.layers {
            let mlp = &self.mlps[layer.message];
            layer.sender = packer.sequence(|p| p.input(mlp, 0, Order::Forward));
            layer.receiver = packer.sequence(|p| p.input(mlp, 1, Order::Forward));
            layer.to_nodes = packer.sequence(|p| {
                p.input(mlp, 0, Order::Transposed);
                p.input(mlp, 1, Order::Transposed);
            });
        }
        self.packs = packer.packs;
        self.words = packer.words;
    }
}

/// MLPs in the order of their weights.
struct MlpList<'a> {
    config: &'a ModelConfig,
    mlps: Vec<Mlp>,
    parameters: usize,
}

impl MlpList<'_> {
    /// Adds an MLP, and gives its number.
    fn add(&mut self, inputs: Vec<Input>) -> usize {
        let mlp = Mlp {
            offset: self.parameters,
            inputs,
            width: self.config.width,
            layers: self.config.hidden_layers,
            columns: self.config.width,
            norm: true,
            forward: Packed::default(),
            backward: Packed::default(),
        };
        self.parameters = mlp.end();
        self.mlps.push(mlp);
        self.mlps.len() - 1
    }
}

/// How a matrix is packed (weights.cu).
#[derive(Clone, Copy, PartialEq, Eq)]
enum Order {
    /// For a product with the matrix.
    Forward,
    /// For a product with the transposed matrix.
    Transposed,
    /// Row after row, for `edges_backward`.
    Plain,
}

/// Rows of a step, steps of a matrix of 128 x 128, and words of a step.
const STEP_ROWS: usize = 16;
const STEPS: usize = 8;
const STEP_WORDS: usize = MATRIX_WORDS / STEPS;

/// Lays packed matrices out, one after the other.
struct Packer {
    /// Two-byte numbers whose sum is a weight.
    parts: usize,
    packs: Vec<Pack>,
    words: usize,
}

impl Packer {
    /// Lays out the matrices that `fill` adds.
    fn sequence(&mut self, fill: impl FnOnce(&mut Self)) -> Packed {
        let first = self.words;
        fill(self);
        Packed { first, words: self.words - first }
    }

    /// The rows of the first linear that act on an input.
    fn input(&mut self, mlp: &Mlp, input: usize, order: Order) {
        let kind = mlp.inputs[input];
        let (rows, columns) = (mlp.columns_of(kind), mlp.outputs(0));
        let from = mlp.weight(0) + mlp.first_row(input) * columns;
        self.matrix(from, rows, columns, order, kind != Input::State);
    }

    /// The matrix of a linear but the first.
    fn linear(&mut self, mlp: &Mlp, layer: usize, order: Order) {
        self.matrix(mlp.weight(layer), mlp.width, mlp.outputs(layer), order, false);
    }

    fn matrix(&mut self, from: usize, rows: usize, columns: usize, order: Order, features: bool) {
        let steps = if features { rows.div_ceil(STEP_ROWS) } else { STEPS };
        // Features carry positions: sums of two float16 in either precision.
        let parts = if features { 2 } else { self.parts };
        self.packs.push(Pack {
            from: from as i32,
            stride: columns as i32,
            rows: rows as i32,
            columns: columns as i32,
            transposed: i32::from(order == Order::Transposed),
            steps: steps as i32,
            features: i32::from(features),
            parts: parts as i32,
            plain: i32::from(order == Order::Plain),
            to: self.words as i32,
        });
        self.words += parts * steps * STEP_WORDS;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::PAPER_NETWORKS;

    #[test]
    fn the_lists_of_weights_are_as_long_as_the_networks() {
        for name in PAPER_NETWORKS.into_iter().chain(["gns"]) {
            for dimensions in [2, 3] {
                let config = ModelConfig { dimensions, ..ModelConfig::named(name).unwrap() };
                let layout = Layout::new(&config, Precision::Bf16, true);
                assert_eq!(layout.parameters, config.parameter_count(), "{name}");
            }
        }
    }
}
