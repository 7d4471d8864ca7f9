//! Initial weights of a training.

use std::path::PathBuf;

use burn::module::Param;
use burn::tensor::Tensor;
use burn::tensor::backend::Backend;
use serde::{Deserialize, Serialize};

use super::config::ModelConfig;
use super::message::MessageLayer;
use super::mlp::Mlp;
use super::model::Model;

/// Initial weights: `"random"`, `"identity"` or a weights file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Initialisation {
    /// PyTorch's default random weights.
    #[default]
    Random,
    /// Random weights close to layers that pass node states on (TGNNS).
    Identity,
    /// The weights of a trained model.
    Weights(PathBuf),
}

impl TryFrom<String> for Initialisation {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        match text.as_str() {
            "random" => Ok(Self::Random),
            "identity" => Ok(Self::Identity),
            file if file.ends_with(".safetensors") => Ok(Self::Weights(file.into())),
            _ => Err(format!(
                "`start` is {text:?}, but it must be \"random\", \"identity\" or a file of weights \
                 (*.safetensors)"
            )),
        }
    }
}

impl From<Initialisation> for String {
    fn from(initialisation: Initialisation) -> Self {
        match initialisation {
            Initialisation::Random => "random".to_owned(),
            Initialisation::Identity => "identity".to_owned(),
            Initialisation::Weights(path) => path.to_string_lossy().into_owned(),
        }
    }
}

/// Scale of the random weights beside the identity.
const RANDOM_PART: f64 = 0.4;

/// Scale of LayerNorm for messages, of which a node sums some 44.
const MESSAGE_SCALE: f64 = 0.1;

impl<B: Backend> Model<B> {
    /// A trained TGNNS with as many residual layers as `config` has. It predicts as before, since the layers
    /// it did not have add nothing yet.
    pub fn grown(mut self, config: &ModelConfig, seed: u64, device: &B::Device) -> Self {
        if let (Self::Tgnns(trained), Self::Tgnns(new)) =
            (&mut self, Self::new(config, seed, device))
        {
            let known = trained.residual_layers.len();
            trained.residual_layers.extend(new.residual_layers.into_iter().skip(known));
        }
        self
    }

    /// Makes node states pass through the layers of a TGNNS, which has no residual connections and
    /// would lose most of them in some 40 random linear layers. Multiples of the identity are added
    /// to the scaled weights, so that S averages its inputs, messages begin as h_w - h_v + e, and
    /// updates as h_v plus a fraction of the messages. A GNS is returned unchanged.
    pub fn near_identity(mut self) -> Self {
        let Self::Tgnns(network) = &mut self else { return self };
        network.node_fusion.add_identity(&[0.7, 0.7]);
        if let Some(fusion) = &mut network.edge_fusion {
            fusion.add_identity(&[0.7]);
        }
        for layer in network.frame_layers.iter_mut().chain(&mut network.message_layers) {
            let MessageLayer { message, update } = layer;
            message.add_identity(&[0.6, -0.6, 0.6]);
            update.add_identity(&[1.0, 0.3]);
            if let Some(norm) = &mut message.norm {
                edit(&mut norm.gamma, |gamma| gamma.mul_scalar(MESSAGE_SCALE));
            }
        }
        network.decoder.add_identity(&[]);
        self
    }
}

impl<B: Backend> MessageLayer<B> {
    /// For a residual layer: its update is 0 until the scale of the update's LayerNorm has learnt otherwise.
    pub(super) fn adding_nothing(mut self) -> Self {
        let Self { message, update } = &mut self;
        for (mlp, scale) in [(message, MESSAGE_SCALE), (update, 0.0)] {
            if let Some(norm) = &mut mlp.norm {
                edit(&mut norm.gamma, |gamma| gamma.mul_scalar(scale));
            }
        }
        self
    }
}

impl<B: Backend> Mlp<B> {
    /// Scales the weights and adds the identity to all square ones but the first; to each square
    /// block of the first, which reads states side by side, a multiple of it.
    fn add_identity(&mut self, first: &[f64]) {
        for (layer, linear) in self.linears.iter_mut().enumerate() {
            let [inputs, outputs] = linear.weight.dims();
            let blocks = match layer {
                0 => first,
                _ if inputs == outputs => &[1.0],
                _ => &[],
            };
            if !blocks.is_empty() {
                edit(&mut linear.weight, |weight| weight.mul_scalar(RANDOM_PART));
            }
            for (block, &factor) in blocks.iter().enumerate() {
                let rows = block * outputs..(block + 1) * outputs;
                edit(&mut linear.weight, |weight| {
                    let identity = Tensor::eye(outputs, &weight.device()).mul_scalar(factor);
                    let old = weight.clone().slice_dim(0, rows.clone());
                    weight.slice_assign([rows.clone(), 0..outputs], old + identity)
                });
            }
        }
    }
}

/// Replaces the value of a parameter.
fn edit<B: Backend, const D: usize>(
    param: &mut Param<Tensor<B, D>>,
    change: impl FnOnce(Tensor<B, D>) -> Tensor<B, D>,
) {
    let value = param.val();
    let learns = value.is_require_grad();
    let changed = change(value).detach().set_require_grad(learns);
    *param = Param::initialized(param.id, changed);
}
