//! The graph network simulator (GNS) of Sanchez-Gonzalez et al. (ICML 2020), the paper's baseline.

use burn::module::Module;
use burn::tensor::Tensor;
use burn::tensor::backend::Backend;
use rand_chacha::ChaCha8Rng;

use super::config::ModelConfig;
use super::message::MessageLayer;
use super::mlp::Mlp;
use crate::features::WindowInput;

/// Message passing with residual connections on the graph of the last frame. Nodes have all
/// velocities of the window.
#[derive(Module, Debug)]
pub struct Gns<B: Backend> {
    /// Velocities of the window and distances to the walls -> node state.
    pub node_encoder: Mlp<B>,
    /// Displacement and distance -> edge state.
    pub edge_encoder: Mlp<B>,
    /// Message passing, each layer added to the states before it.
    pub layers: Vec<MessageLayer<B>>,
    /// Node state -> normalised acceleration.
    pub decoder: Mlp<B>,
}

impl<B: Backend> Gns<B> {
    pub(crate) fn new(config: &ModelConfig, rng: &mut ChaCha8Rng, device: &B::Device) -> Self {
        let mut mlp = |input| config.mlp(input, config.width).init(rng, device);
        Self {
            node_encoder: mlp(config.gns_node_features()),
            edge_encoder: mlp(config.first_edge_features()),
            layers: (0..config.gns_layers)
                .map(|_| MessageLayer::new(config, rng, device))
                .collect(),
            decoder: config.decoder().init(rng, device),
        }
    }

    pub(crate) fn forward(&self, input: &WindowInput<B>) -> Tensor<B, 2> {
        let graph = &input.frames[input.frames.len() - 1];
        let mut nodes = self.node_encoder.forward(graph.nodes.clone());
        let mut edges = self.edge_encoder.forward(graph.edges.clone());
        for layer in &self.layers {
            let (updated, messages) = layer.forward(nodes.clone(), edges.clone(), graph);
            nodes = nodes + updated;
            edges = edges + messages;
        }
        self.decoder.forward(nodes)
    }
}
