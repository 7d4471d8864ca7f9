//! What computes a training step on the processor: network, gradients and optimiser.

use std::sync::{Mutex, MutexGuard, PoisonError};

use burn::module::AutodiffModule;
use burn::tensor::{Tensor, TensorData};
use gpu::ranks::RanksError;
use serde::{Deserialize, Serialize};

use super::adam::Adam;
use super::config::{LossOver, TrainConfig};
use super::parameters::{gradients, weights, with_weights};
use super::ranks::AllReduce;
use crate::backend::{Cpu, CpuAutodiff, Device, device};
use crate::config::ModelConfig;
use crate::data::Batch;
use crate::features::{Normalisation, Window, WindowInput, window_input};
use crate::model::Model;

/// Keeps the loss finite when nothing accelerates.
const SMALLEST_TARGET: f32 = 1e-12;

/// Everything that changes in training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    pub weights: Vec<f32>,
    pub adam: Adam,
    /// Moving average of the weights, if there is one.
    pub average: Option<Vec<f32>>,
    /// Steps made.
    pub step: u64,
}

impl State {
    /// That of a training that starts from these weights.
    pub fn new(weights: Vec<f32>, averaging: bool) -> Self {
        let adam = Adam::new(weights.len());
        let average = averaging.then(|| weights.clone());
        Self { weights, adam, average, step: 0 }
    }
}

/// Network and optimiser in training.
pub struct CpuEngine {
    model: Model<CpuAutodiff>,
    state: State,
    decay: f64,
    /// Added in squares to the squared targets of the loss.
    floor: f32,
    over: LossOver,
    /// Losses that nobody has read yet.
    losses: Vec<f64>,
}

/// A batch on the device, as a graph.
pub struct Prepared {
    input: WindowInput<CpuAutodiff>,
    targets: Tensor<CpuAutodiff, 2>,
}

/// Makes graphs of batches.
#[derive(Clone, Debug)]
pub struct Preparation {
    pub config: ModelConfig,
    pub normalisation: Normalisation,
    /// Walls of the domain, m.
    pub bounds: [[f64; 2]; 2],
}

impl Preparation {
    /// Builds the graphs of a batch; may run ahead of the training on another thread.
    pub fn prepare(&self, batch: &Batch) -> Prepared {
        let device: Device = device();
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
        let input =
            window_input(&windows, &self.config, &self.normalisation, &self.bounds, &device);
        let shape = [batch.targets.len() / 2, 2];
        let targets = Tensor::from_data(TensorData::new(batch.targets.clone(), shape), &device);
        Prepared { input, targets }
    }
}

/// Burn keeps one list of the graphs of all threads, and engines that go through theirs at the same time
/// get wrong gradients now and then (4 in 160 runs of the tests). A training is one engine; tests have several.
fn alone() -> MutexGuard<'static, ()> {
    static GRAPHS: Mutex<()> = Mutex::new(());
    GRAPHS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Decay of the moving average of the weights at a step, the first of which is 1. Early on the
/// average follows, lest it remembers the random start.
pub fn average_decay(decay: f64, step: u64) -> f32 {
    let step = step as f64;
    decay.min((1.0 + step) / (10.0 + step)) as f32
}

impl CpuEngine {
    /// The network that a training starts from.
    pub fn new(model: &ModelConfig, config: &TrainConfig) -> Self {
        let model = config.start(model, &device());
        let state = State::new(weights(&model), config.ema > 0.0);
        let floor = config.loss_floor as f32;
        let over = config.loss_over;
        Self { model, state, decay: config.ema, floor, over, losses: Vec::new() }
    }

    /// Continues from a state; `false` if it is that of another network.
    #[must_use]
    pub fn resume(&mut self, state: State) -> bool {
        let count = self.state.weights.len();
        let lengths = [Some(&state.weights), state.average.as_ref()];
        if lengths.into_iter().flatten().any(|list| list.len() != count)
            || state.adam.len() != count
            || state.average.is_some() != self.state.average.is_some()
        {
            return false;
        }
        self.model = with_weights(self.model.clone(), &state.weights);
        self.state = state;
        true
    }

    /// Where the training is.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// One step: loss sum (a - a*)² / sum (a*² + floor²) over the windows of all ranks, or the mean of
    /// those of each, its gradients, Adam.
    ///
    /// # Errors
    /// If another rank is gone.
    pub fn step(
        &mut self,
        batch: Prepared,
        rate: f64,
        ranks: &mut dyn AllReduce,
    ) -> Result<(), RanksError> {
        let (mut gradients, targets) = self.gradients(batch);
        if self.over == LossOver::Process {
            // So the sums are those of losses and of ones.
            let scale = targets.max(SMALLEST_TARGET);
            gradients.iter_mut().for_each(|sum| *sum /= scale);
            gradients.last_mut().into_iter().for_each(|own| *own = 1.0);
        }
        ranks.sum(&mut gradients)?;
        let scale = gradients.pop().unwrap_or_default().max(SMALLEST_TARGET);
        gradients.iter_mut().for_each(|sum| *sum /= scale);
        self.losses.extend(gradients.pop().map(f64::from));
        self.state.adam.step(&mut self.state.weights, &gradients, rate);
        let alone = alone();
        self.model = with_weights(self.model.clone(), &self.state.weights);
        drop(alone);
        self.state.step += 1;
        if let Some(average) = &mut self.state.average {
            let decay = average_decay(self.decay, self.state.step);
            for (mean, weight) in average.iter_mut().zip(&self.state.weights) {
                *mean = decay * *mean + (1.0 - decay) * weight;
            }
        }
        Ok(())
    }

    /// The gradients of the sum of squared errors, that sum and the one of squared targets, which also
    /// stands beside them.
    fn gradients(&self, batch: Prepared) -> (Vec<f32>, f32) {
        let _alone = alone();
        let squares = batch.targets.clone().powi_scalar(2).add_scalar(self.floor * self.floor);
        let targets = squares.sum().into_scalar();
        let error = self.model.forward(&batch.input) - batch.targets;
        let errors = error.powi_scalar(2).sum();
        let mut gradients = gradients(&self.model, &errors.backward());
        // Both sums go along with the gradients of one of them.
        gradients.extend([errors.into_scalar(), targets]);
        (gradients, targets)
    }

    /// Normalised accelerations that the network as it learns gives for a batch.
    pub fn predict(&self, batch: &Prepared) -> Vec<f32> {
        let _alone = alone();
        self.model.forward(&batch.input).into_data().iter::<f32>().collect()
    }

    /// The losses since this was last asked for.
    pub fn take_losses(&mut self) -> Vec<f64> {
        std::mem::take(&mut self.losses)
    }

    /// The network to use: with averaged weights if there are any.
    pub fn model(&self) -> Model<Cpu> {
        let weights = self.state.average.as_ref().unwrap_or(&self.state.weights);
        with_weights(self.model.valid(), weights)
    }
}
