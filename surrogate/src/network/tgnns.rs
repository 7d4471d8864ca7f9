//! The temporal graph neural network simulator (TGNNS) of the paper.

use burn::module::Module;
use burn::tensor::backend::Backend;
use burn::tensor::{Int, Tensor};
use rand_chacha::ChaCha8Rng;

use super::config::ModelConfig;
use super::message::MessageLayer;
use super::mlp::Mlp;
use crate::features::{FrameInput, WindowInput};

/// One message-passing layer for each frame of the window, on that frame's graph; node states pass
/// from frame to frame. Further layers on the last graph and the decoder follow. There are no
/// residual connections but those of `residual_layers`, which the paper does not have: without them
/// news from the last frame travels one edge in its layer and one in each of the message layers.
#[derive(Module, Debug)]
pub struct Tgnns<B: Backend> {
    /// F_n0: distances to walls, of the first frame.
    pub node_encoder_first: Mlp<B>,
    /// F_n1: velocity and distances to walls, of later frames.
    pub node_encoder_later: Mlp<B>,
    /// F_e0: direction and distance, in the first frame.
    pub edge_encoder_first: Mlp<B>,
    /// F_e1: relative velocity, direction and distance, in later frames.
    pub edge_encoder_later: Mlp<B>,
    /// S: fuses the node state of the previous frame with the encoding of the next.
    pub node_fusion: Mlp<B>,
    /// `edgemsg`: fuses the previous frame's message along a persistent edge with its new features;
    /// new edges are encoded by `edge_encoder_later`.
    pub edge_fusion: Option<Mlp<B>>,
    /// g_k and f_k for each frame.
    pub frame_layers: Vec<MessageLayer<B>>,
    /// g_k and f_k of the layers on the last graph; their edge states are the last messages.
    pub message_layers: Vec<MessageLayer<B>>,
    /// g_k and f_k of the layers after those, which add f_k to the node states.
    pub residual_layers: Vec<MessageLayer<B>>,
    /// F_a: normalised acceleration.
    pub decoder: Mlp<B>,
}

impl<B: Backend> Tgnns<B> {
    pub(crate) fn new(config: &ModelConfig, rng: &mut ChaCha8Rng, device: &B::Device) -> Self {
        let width = config.width;
        let (first_edge, later_edge) = (config.first_edge_features(), config.later_edge_features());
        let mut mlp = |input| config.mlp(input, width).init(rng, device);
        let node_encoder_first = mlp(config.first_node_features());
        let node_encoder_later = mlp(config.later_node_features());
        let edge_encoder_first = mlp(first_edge);
        let edge_encoder_later = mlp(later_edge);
        let node_fusion = mlp(2 * width);
        let edge_fusion = config.edge_message.then(|| mlp(width + later_edge));
        let mut layers =
            |n| -> Vec<_> { (0..n).map(|_| MessageLayer::new(config, rng, device)).collect() };
        let frame_layers = layers(config.frames);
        let message_layers = layers(config.message_layers);
        let residual = layers(config.residual_layers);
        Self {
            node_encoder_first,
            node_encoder_later,
            edge_encoder_first,
            edge_encoder_later,
            node_fusion,
            edge_fusion,
            frame_layers,
            message_layers,
            residual_layers: residual.into_iter().map(MessageLayer::adding_nothing).collect(),
            decoder: config.decoder().init(rng, device),
        }
    }

    pub(crate) fn forward(&self, input: &WindowInput<B>) -> Tensor<B, 2> {
        let mut graph = &input.frames[0];
        let nodes = self.node_encoder_first.forward(graph.nodes.clone());
        let edges = self.edge_encoder_first.forward(graph.edges.clone());
        let (mut nodes, mut messages) = self.frame_layers[0].forward(nodes, edges, graph);
        for (layer, frame) in self.frame_layers.iter().zip(&input.frames).skip(1) {
            graph = frame;
            let encoded = self.node_encoder_later.forward(graph.nodes.clone());
            let fused = self.node_fusion.forward(Tensor::cat(vec![nodes, encoded], 1));
            let edges = self.later_edges(messages, graph);
            (nodes, messages) = layer.forward(fused, edges, graph);
        }
        for layer in &self.message_layers {
            (nodes, messages) = layer.forward(nodes, messages, graph);
        }
        for layer in &self.residual_layers {
            let (update, next) = layer.forward(nodes.clone(), messages, graph);
            (nodes, messages) = (nodes + update, next);
        }
        self.decoder.forward(nodes)
    }

    /// Edge states of a later frame from the previous frame's messages.
    fn later_edges(&self, messages: Tensor<B, 2>, graph: &FrameInput<B>) -> Tensor<B, 2> {
        let (Some(fusion), Some(edges)) = (&self.edge_fusion, &graph.persistence) else {
            return self.edge_encoder_later.forward(graph.edges.clone());
        };
        let features = |edge: &Tensor<B, 1, Int>| graph.edges.clone().select(0, edge.clone());
        let previous = messages.select(0, edges.previous.clone());
        let persistent =
            fusion.forward(Tensor::cat(vec![previous, features(&edges.persistent)], 1));
        let new = self.edge_encoder_later.forward(features(&edges.new));
        Tensor::cat(vec![persistent, new], 0).select(0, edges.place.clone())
    }
}
