//! Training steps with Burn: network and gradients on its device, the optimiser on the host.

use std::sync::{Mutex, MutexGuard, PoisonError};

use burn::tensor::backend::AutodiffBackend;
use burn::tensor::{ElementConversion, Tensor};
use gpu::ranks::RanksError;

use super::all_reduce::AllReduce;
use super::config::{LossOver, TrainConfig};
use super::input::BurnBatch;
use super::schedule::average_decay;
use super::state::State;
use crate::network::burn_backend::{Cpu, device as cpu};
use crate::network::parameters::{HiddenMatrix, gradients, weights, with_weights};
use crate::network::{Model, ModelConfig};

/// Keeps the loss finite without accelerations.
const SMALLEST_TARGET: f32 = 1e-12;

/// Network and optimiser in training.
pub struct BurnBackend<B: AutodiffBackend> {
    model: Model<B>,
    device: B::Device,
    /// A network of this architecture, whose weights are replaced.
    shape: Model<Cpu>,
    state: State,
    /// Decay of the moving average of the weights.
    decay: f64,
    /// Its square is added to each squared target in the loss.
    floor: f32,
    over: LossOver,
    /// Matrices that Muon updates.
    muon: Vec<HiddenMatrix>,
    /// Losses not read yet.
    losses: Vec<f64>,
}

/// Burn keeps one list of the autodiff graphs of all threads. Backends that walk theirs at the same
/// time sometimes get wrong gradients (4 in 160 runs of the tests). A training has one backend;
/// tests have several.
fn lock_graphs() -> MutexGuard<'static, ()> {
    static GRAPHS: Mutex<()> = Mutex::new(());
    GRAPHS.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<B: AutodiffBackend> BurnBackend<B> {
    /// A training with its initial weights.
    pub fn new(device: B::Device, model: &ModelConfig, config: &TrainConfig) -> Self {
        let shape = config.initial_network(model, &cpu());
        let start = weights(&shape);
        let muon = config.muon_matrices(&shape, model.width);
        Self {
            model: with_weights(Model::new(model, 0, &device), &start),
            device,
            shape,
            state: State::new(start, config.ema > 0.0),
            decay: config.ema,
            floor: config.loss_floor as f32,
            over: config.loss_over,
            muon,
            losses: Vec::new(),
        }
    }

    /// The device of Burn.
    pub fn device(&self) -> &B::Device {
        &self.device
    }

    /// Continues from a state; `false` if it belongs to another network.
    #[must_use]
    pub fn resume(&mut self, state: State) -> bool {
        let count = self.state.weights.len();
        let lengths = [Some(&state.weights), state.average.as_ref()];
        if lengths.into_iter().flatten().any(|list| list.len() != count)
            || state.moments.len() != count
            || state.average.is_some() != self.state.average.is_some()
        {
            return false;
        }
        self.model = with_weights(self.model.clone(), &state.weights);
        self.state = state;
        true
    }

    /// The state after the last step.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// One step of the optimiser at the learning rate `rate`. The loss is sum (a - a*)² / sum (a*² + floor²)
    /// over the windows of all ranks, or the mean of what all ranks or all windows have
    /// ([`LossOver`]).
    ///
    /// # Errors
    /// If another rank is gone.
    pub fn step(
        &mut self,
        batch: BurnBatch<B>,
        rate: f64,
        ranks: &mut dyn AllReduce,
    ) -> Result<(), RanksError> {
        let mut gradients = self.gradients(batch);
        ranks.sum(&mut gradients)?;
        let scale = gradients.pop().unwrap_or_default().max(SMALLEST_TARGET);
        gradients.iter_mut().for_each(|sum| *sum /= scale);
        self.losses.extend(gradients.pop().map(f64::from));
        self.state.moments.step(&mut self.state.weights, &gradients, rate, &self.muon);
        let lock = lock_graphs();
        self.model = with_weights(self.model.clone(), &self.state.weights);
        drop(lock);
        self.state.step += 1;
        if let Some(average) = &mut self.state.average {
            let decay = average_decay(self.decay, self.state.step);
            for (mean, weight) in average.iter_mut().zip(&self.state.weights) {
                *mean = decay * *mean + (1.0 - decay) * weight;
            }
        }
        Ok(())
    }

    /// Gradients of the sum of squared errors, followed by that sum and by the sum of squared
    /// targets. Where the loss is a mean, both sums are relative to the latter, of all points or of each
    /// window.
    fn gradients(&self, batch: BurnBatch<B>) -> Vec<f32> {
        let _lock = lock_graphs();
        let BurnBatch { input, targets, points } = batch;
        let squares = targets.clone().powi_scalar(2).add_scalar(self.floor * self.floor);
        let errors = (self.model.forward(&input) - targets).powi_scalar(2);
        let all = [input.points];
        let groups = if self.over == LossOver::Window { &points[..] } else { &all };
        let mut error = Tensor::<B, 1>::zeros([1], &self.device);
        let (mut scale, mut first) = (0.0, 0);
        for count in groups {
            let sum = |of: &Tensor<B, 2>| of.clone().slice_dim(0, first..first + count).sum();
            let (mut own, own_scale) = (sum(&errors), sum(&squares).into_scalar().elem::<f32>());
            if self.over == LossOver::Step {
                scale += own_scale;
            } else {
                own = own.div_scalar(own_scale.max(SMALLEST_TARGET));
                scale += 1.0;
            }
            error = error + own;
            first += count;
        }
        let mut gradients = gradients(&self.model, &error.backward());
        // Both sums travel with the gradients of one of them.
        gradients.extend([error.into_scalar().elem(), scale]);
        gradients
    }

    /// Normalised accelerations of a batch by the network in training.
    pub fn predict(&self, batch: &BurnBatch<B>) -> Vec<f32> {
        let _lock = lock_graphs();
        self.model.forward(&batch.input).into_data().iter::<f32>().collect()
    }

    /// The losses since the last call.
    pub fn take_losses(&mut self) -> Vec<f64> {
        std::mem::take(&mut self.losses)
    }

    /// The network to use, with averaged weights if there are any.
    pub fn model(&self) -> Model<Cpu> {
        let weights = self.state.average.as_ref().unwrap_or(&self.state.weights);
        with_weights(self.shape.clone(), weights)
    }
}
