//! Multilayer perceptrons.

use burn::module::{Module, Param};
use burn::nn::{LayerNorm, LayerNormConfig, Linear};
use burn::tensor::activation::leaky_relu;
use burn::tensor::backend::Backend;
use burn::tensor::{Tensor, TensorData};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::blocks::{block, in_blocks};

/// Sizes of an [`Mlp`].
#[derive(Clone, Debug)]
pub struct MlpShape {
    /// Columns of the input.
    pub input: usize,
    /// Width of the hidden layers.
    pub width: usize,
    /// Number of hidden layers, at least 1.
    pub hidden_layers: usize,
    /// Columns of the output.
    pub output: usize,
    /// Whether LayerNorm follows.
    pub norm: bool,
    /// Slope of LeakyReLU for negative arguments; 0 is ReLU.
    pub slope: f64,
}

impl MlpShape {
    /// (inputs, outputs) of each linear.
    fn linears(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        (0..=self.hidden_layers).map(|layer| {
            let input = if layer == 0 { self.input } else { self.width };
            let output = if layer == self.hidden_layers { self.output } else { self.width };
            (input, output)
        })
    }

    /// Number of trainable parameters.
    pub fn parameter_count(&self) -> usize {
        let linears: usize = self.linears().map(|(input, output)| (input + 1) * output).sum();
        linears + if self.norm { 2 * self.output } else { 0 }
    }

    /// Weights and biases uniform in ±1/sqrt(inputs), PyTorch's default; LayerNorm as the identity.
    /// They are drawn on the host, so they are the same on every device.
    pub(crate) fn init<B: Backend>(&self, rng: &mut ChaCha8Rng, device: &B::Device) -> Mlp<B> {
        let linears = self
            .linears()
            .map(|(input, output)| {
                let bound = 1.0 / (input as f32).sqrt();
                let mut draw = |n: usize| -> Vec<f32> {
                    (0..n).map(|_| rng.random_range(-bound..bound)).collect()
                };
                let weight = TensorData::new(draw(input * output), [input, output]);
                let bias = TensorData::new(draw(output), [output]);
                Linear {
                    weight: Param::from_tensor(Tensor::from_data(weight, device)),
                    bias: Some(Param::from_tensor(Tensor::from_data(bias, device))),
                }
            })
            .collect();
        let norm = self.norm.then(|| LayerNormConfig::new(self.output).init(device));
        Mlp { linears, norm, slope: self.slope }
    }
}

/// Linear, then LeakyReLU and Linear for each hidden layer, then LayerNorm except in the decoder.
#[derive(Module, Debug)]
pub struct Mlp<B: Backend> {
    /// Linear layers, from input to output.
    pub linears: Vec<Linear<B>>,
    /// LayerNorm of the output.
    pub norm: Option<LayerNorm<B>>,
    slope: f64,
}

impl<B: Backend> Mlp<B> {
    /// Outputs (rows x outputs) of inputs (rows x inputs).
    pub fn forward(&self, input: Tensor<B, 2>) -> Tensor<B, 2> {
        in_blocks(input.dims()[0], &input.device(), |rows| {
            self.after_first(self.linears[0].forward(block(&input, &rows)))
        })
    }

    /// Everything after the first linear layer.
    pub(crate) fn after_first(&self, mut x: Tensor<B, 2>) -> Tensor<B, 2> {
        for linear in &self.linears[1..] {
            x = linear.forward(leaky_relu(x, self.slope));
        }
        match &self.norm {
            Some(norm) => norm.forward(x),
            None => x,
        }
    }
}
