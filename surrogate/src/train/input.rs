//! Network inputs of a batch for Burn.

use burn::tensor::backend::Backend;
use burn::tensor::{Tensor, TensorData};

use crate::data::Batch;
use crate::features::{Normalisation, Window, WindowInput, window_input};
use crate::network::ModelConfig;

/// What the inputs depend on besides the batch.
#[derive(Clone, Debug)]
pub struct InputSpec {
    /// The network.
    pub config: ModelConfig,
    /// Normalisation of inputs and targets.
    pub normalisation: Normalisation,
    /// Walls of the domain, m.
    pub bounds: [[f64; 2]; 2],
}

/// A batch as tensors.
pub struct BurnBatch<B: Backend> {
    /// Graphs and features of the windows.
    pub input: WindowInput<B>,
    /// Normalised accelerations, points x 2.
    pub targets: Tensor<B, 2>,
    /// Points of each window.
    pub points: Vec<usize>,
}

impl InputSpec {
    /// Builds the graphs of a batch; can run on another thread ahead of the training.
    pub fn build<B: Backend>(&self, batch: &Batch, device: &B::Device) -> BurnBatch<B> {
        let windows = batch.windows.iter().zip(&batch.points).zip(&batch.statics);
        let windows = windows.zip(&batch.obstacles);
        let windows: Vec<Window> = windows
            .map(|(((positions, &points), statics), obstacles)| Window {
                positions,
                points,
                statics,
                obstacles,
            })
            .collect();
        let input = window_input(&windows, &self.config, &self.normalisation, &self.bounds, device);
        let shape = [batch.targets.len() / 2, 2];
        let targets = Tensor::from_data(TensorData::new(batch.targets.clone(), shape), device);
        BurnBatch { input, targets, points: batch.points.clone() }
    }
}
