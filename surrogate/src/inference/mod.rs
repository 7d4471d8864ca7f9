//! Fast inference on the CPU: the results of [`Model::forward`] up to rounding, without its passes
//! over memory, and with encodings of frames reused from window to window.

mod message;
mod mlp;

use burn::tensor::backend::Backend;
use burn::tensor::{Int, Tensor};

use self::message::{EdgeStates, Edges, MessageLayer};
use self::mlp::Mlp;
use crate::features::{FrameInput, WindowInput};
use crate::network::burn_backend::Cpu;
#[cfg(feature = "burn-cuda")]
use crate::network::burn_backend::{Gpu, GpuDevice};
#[cfg(feature = "burn-cuda")]
use crate::network::parameters::{weights, with_weights};
use crate::network::{Model, ModelConfig, Tgnns};

/// A network for inference.
pub enum Inference {
    /// Blocked layers.
    Tgnns(Box<Layers>),
    /// Burn, for networks without blocked layers.
    Plain(Box<Model<Cpu>>),
    /// Burn on a GPU.
    #[cfg(feature = "burn-cuda")]
    Gpu(Box<Model<Gpu>>, GpuDevice),
}

impl Inference {
    /// Prepares the network for `windows` windows that advance in turn.
    pub fn new(model: &Model<Cpu>, config: &ModelConfig, windows: usize) -> Self {
        match model {
            Model::Tgnns(network) if network.edge_fusion.is_none() => {
                Self::Tgnns(Box::new(Layers::new(network, config, windows)))
            }
            other => Self::Plain(Box::new(other.clone())),
        }
    }

    /// The network on a GPU, computed by Burn.
    #[cfg(feature = "burn-cuda")]
    pub fn on_gpu(model: &Model<Cpu>, config: &ModelConfig, device: GpuDevice) -> Self {
        let there = with_weights(Model::new(config, 0, &device), &weights(model));
        Self::Gpu(Box::new(there), device)
    }

    /// Normalised accelerations in the last frame, points x 2.
    pub fn forward(&mut self, input: &WindowInput<Cpu>) -> Vec<f32> {
        match self {
            Self::Tgnns(layers) => layers.forward(input),
            Self::Plain(model) => model.forward(input).into_data().iter::<f32>().collect(),
            #[cfg(feature = "burn-cuda")]
            Self::Gpu(model, device) => {
                model.forward(&input.to_device(device)).into_data().iter::<f32>().collect()
            }
        }
    }
}

/// A TGNNS without `edgemsg`, in blocked layers.
pub struct Layers {
    /// Encoders of the first frame of a window and of later ones.
    first: Encoder,
    later: Encoder,
    node_fusion: Mlp,
    frame_layers: Vec<MessageLayer>,
    message_layers: Vec<MessageLayer>,
    residual_layers: Vec<MessageLayer>,
    decoder: Mlp,
}

/// Encoders of nodes and edges, with the last encoded frames.
struct Encoder {
    nodes: Mlp,
    edges: Mlp,
    known: Vec<Encoding>,
    room: usize,
}

/// A frame and its encoding.
struct Encoding {
    node_features: Vec<f32>,
    edge_features: Vec<f32>,
    nodes: Vec<f32>,
    edges: Vec<f32>,
}

impl Encoder {
    /// The encoding of a frame, reused if an earlier window had the frame.
    fn encode(&mut self, frame: &FrameInput<Cpu>) -> &Encoding {
        let numbers =
            |tensor: &Tensor<Cpu, 2>| -> Vec<f32> { tensor.to_data().iter::<f32>().collect() };
        let (node_features, edge_features) = (numbers(&frame.nodes), numbers(&frame.edges));
        let same = |known: &Encoding| {
            known.edge_features == edge_features && known.node_features == node_features
        };
        let encoding = match self.known.iter().position(same) {
            Some(place) => self.known.remove(place),
            None => {
                // The least recently used one makes room.
                if self.known.len() >= self.room {
                    self.known.remove(0);
                }
                let rows = |tensor: &Tensor<Cpu, 2>| tensor.dims()[0];
                let nodes = self.nodes.forward(&[&node_features], rows(&frame.nodes));
                let edges = self.edges.forward(&[&edge_features], rows(&frame.edges));
                Encoding { node_features, edge_features, nodes, edges }
            }
        };
        self.known.push(encoding);
        &self.known[self.known.len() - 1]
    }
}

impl Layers {
    fn new<B: Backend>(network: &Tgnns<B>, config: &ModelConfig, windows: usize) -> Self {
        let slope = config.leaky_slope;
        let layers = |list: &[crate::network::MessageLayer<B>]| {
            list.iter().map(|layer| MessageLayer::new(layer, slope)).collect()
        };
        Self {
            first: Encoder {
                nodes: Mlp::new(&network.node_encoder_first, slope),
                edges: Mlp::new(&network.edge_encoder_first, slope),
                known: Vec::new(),
                room: windows,
            },
            later: Encoder {
                nodes: Mlp::new(&network.node_encoder_later, slope),
                edges: Mlp::new(&network.edge_encoder_later, slope),
                known: Vec::new(),
                room: windows * (config.frames - 1),
            },
            node_fusion: Mlp::new(&network.node_fusion, slope),
            frame_layers: layers(&network.frame_layers),
            message_layers: layers(&network.message_layers),
            residual_layers: layers(&network.residual_layers),
            decoder: Mlp::new(&network.decoder, slope),
        }
    }

    /// As [`Tgnns`] computes it.
    fn forward(&mut self, input: &WindowInput<Cpu>) -> Vec<f32> {
        let points = input.points;
        let (mut nodes, mut messages) = (Vec::new(), Vec::new());
        let mut edges = Edges::default();
        let further = self.message_layers.len() + self.residual_layers.len();
        for (k, (layer, frame)) in self.frame_layers.iter().zip(&input.frames).enumerate() {
            let encoding = if k == 0 { &mut self.first } else { &mut self.later }.encode(frame);
            nodes = match k {
                0 => encoding.nodes.clone(),
                _ => self.node_fusion.forward(&[&nodes, &encoding.nodes], points),
            };
            edges = compress(frame, points);
            // The last frame's messages are the edge states of the following layers.
            let last = k + 1 == input.frames.len() && further > 0;
            let states = if last {
                messages.clone_from(&encoding.edges);
                EdgeStates::Replaced(&mut messages)
            } else {
                EdgeStates::Kept(&encoding.edges)
            };
            nodes = layer.forward(&nodes, states, &edges);
        }
        let layers = self.message_layers.iter().chain(&self.residual_layers);
        for (k, layer) in layers.enumerate() {
            let states = match k + 1 == further {
                true => EdgeStates::Kept(&messages),
                false => EdgeStates::Replaced(&mut messages),
            };
            let mut updated = layer.forward(&nodes, states, &edges);
            if k >= self.message_layers.len() {
                updated.iter_mut().zip(&nodes).for_each(|(new, old)| *new += old);
            }
            nodes = updated;
        }
        self.decoder.forward(&[&nodes], points)
    }
}

/// The edges of a frame in compressed sparse rows.
fn compress(frame: &FrameInput<Cpu>, points: usize) -> Edges {
    let numbers = |tensor: &Tensor<Cpu, 1, Int>| -> Vec<u32> {
        tensor.to_data().iter::<i64>().map(|k| k as u32).collect()
    };
    let mut start = vec![0; points + 1];
    for receiver in numbers(&frame.receiver) {
        start[receiver as usize + 1] += 1;
    }
    for point in 0..points {
        start[point + 1] += start[point];
    }
    Edges { start, sender: numbers(&frame.sender) }
}
