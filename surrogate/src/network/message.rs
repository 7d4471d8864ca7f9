//! One message-passing layer, shared by both networks.

use burn::module::Module;
use burn::tensor::backend::Backend;
use burn::tensor::{IndexingUpdateOp, Tensor};
use rand_chacha::ChaCha8Rng;

use super::blocks::{block, in_blocks};
use super::config::ModelConfig;
use super::mlp::Mlp;
use crate::features::FrameInput;

/// Messages m_wv = g([h_w, h_v, h_e]) along each edge w -> v, then node states
/// h_v' = f([h_v, sum of m_wv over w]).
#[derive(Module, Debug)]
pub struct MessageLayer<B: Backend> {
    /// g, with 3 x width inputs.
    pub message: Mlp<B>,
    /// f, with 2 x width inputs.
    pub update: Mlp<B>,
}

impl<B: Backend> MessageLayer<B> {
    pub(crate) fn new(config: &ModelConfig, rng: &mut ChaCha8Rng, device: &B::Device) -> Self {
        let width = config.width;
        Self {
            message: config.mlp(3 * width, width).init(rng, device),
            update: config.mlp(2 * width, width).init(rng, device),
        }
    }

    /// New node states (points x width) and messages (edges x width) from node and edge states.
    pub fn forward(
        &self,
        nodes: Tensor<B, 2>,
        edges: Tensor<B, 2>,
        graph: &FrameInput<B>,
    ) -> (Tensor<B, 2>, Tensor<B, 2>) {
        let messages = self.messages(nodes.clone(), edges, graph);
        let received = nodes.zeros_like().select_assign(
            0,
            graph.receiver.clone(),
            messages.clone(),
            IndexingUpdateOp::Add,
        );
        (self.update.forward(Tensor::cat(vec![nodes, received], 1)), messages)
    }

    /// g along every edge. Its first linear layer acts on `[h_w, h_v, h_e]` as
    /// W_w h_w + W_v h_v + W_e h_e. The first two terms are computed per node and gathered: a graph
    /// has some 40 times more edges than nodes.
    fn messages(
        &self,
        nodes: Tensor<B, 2>,
        edges: Tensor<B, 2>,
        graph: &FrameInput<B>,
    ) -> Tensor<B, 2> {
        let first = &self.message.linears[0];
        let weight = first.weight.val();
        let width = nodes.dims()[1];
        let part = |k: usize| weight.clone().slice_dim(0, k * width..(k + 1) * width);
        let (of_sender, of_receiver) = (nodes.clone().matmul(part(0)), nodes.matmul(part(1)));
        in_blocks(edges.dims()[0], &edges.device(), |rows| {
            let mut sum = block(&edges, &rows).matmul(part(2))
                + of_sender.clone().select(0, block(&graph.sender, &rows))
                + of_receiver.clone().select(0, block(&graph.receiver, &rows));
            if let Some(bias) = &first.bias {
                sum = sum + bias.val().unsqueeze();
            }
            self.message.after_first(sum)
        })
    }
}
