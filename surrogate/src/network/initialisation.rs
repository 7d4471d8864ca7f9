//! Weights to start a training from.

use std::path::PathBuf;

use burn::module::Param;
use burn::tensor::Tensor;
use burn::tensor::backend::Backend;
use serde::{Deserialize, Serialize};

use super::message::MessageLayer;
use super::mlp::Mlp;
use super::model::Model;

/// Where a training begins.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Initialisation {
    /// Random weights, as PyTorch draws them.
    #[default]
    Random,
    /// Random weights, with which the layers of a TGNNS hand node states on.
    Identity,
    /// The weights of a model that was trained before, a file.
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

/// What is left of random weights beside the identity.
const RANDOM_PART: f64 = 0.4;

/// LayerNorm's scale of messages: a node adds up some 44 of them.
const MESSAGE_SCALE: f64 = 0.1;

impl<B: Backend> Model<B> {
    /// Makes node states pass through the layers of a TGNNS, which has no residual connections:
    /// through some 40 random linears little of them is left at first. Multiples of the identity
    /// are added to a part of the weights, so that S takes the mean of both its inputs, messages begin as
    /// h_w - h_v + e, and updates as h_v and a part of the messages. The GNS stays as it is.
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

impl<B: Backend> Mlp<B> {
    /// Adds the identity to a part of all square weights but the first, and so many times the
    /// identity to each block of a part of the first, which reads states side by side.
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

/// Replaces the value of a parameter, which stays one.
fn edit<B: Backend, const D: usize>(
    param: &mut Param<Tensor<B, D>>,
    change: impl FnOnce(Tensor<B, D>) -> Tensor<B, D>,
) {
    let value = param.val();
    let learns = value.is_require_grad();
    let changed = change(value).detach().set_require_grad(learns);
    *param = Param::initialized(param.id, changed);
}
