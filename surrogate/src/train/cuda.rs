//! Training on a GPU.

use std::sync::Arc;

use gpu::Device;
use gpu::ranks::Ranks;

use super::config::{LossOver, TrainConfig};
use super::input::InputSpec;
use super::optimiser::Moments;
use super::schedule::average_decay;
use super::state::State;
use crate::cuda::{
    BatchBuilder, Capacity, CudaError, CudaTrainer, DeviceBatch, EDGES_PER_POINT, HostWindows,
    LOSSES, Rates, Targets,
};
use crate::data::{Examples, Recipe};
use crate::network::Model;
use crate::network::ModelConfig;
use crate::network::burn_backend::{Cpu, device as cpu};
use crate::network::parameters::{weights, with_weights};

/// Twin of [`BurnBackend`](super::burn::BurnBackend), with the same states.
pub struct CudaBackend {
    device: Arc<Device>,
    trainer: CudaTrainer,
    /// A network of this architecture, whose weights are replaced.
    model: Model<Cpu>,
    /// Builds the graphs and features of batches.
    builder: Option<BatchBuilder>,
    over: LossOver,
    decay: f64,
    averaging: bool,
    optimiser_steps: u64,
    step: u64,
    /// Losses read, and the number of those still on the device.
    losses: Vec<f64>,
    unread: usize,
}

/// A batch for a GPU, which builds the graphs.
pub struct CudaBatch {
    /// Positions and targets.
    pub windows: HostWindows,
    /// What the inputs depend on besides.
    pub spec: Arc<InputSpec>,
}

impl CudaBatch {
    /// The host's part of the work; can run on another thread ahead of the training. The network in
    /// training unrolls the windows as the examples ask.
    pub fn new(recipe: &Recipe, examples: &Examples, spec: &Arc<InputSpec>) -> Self {
        let windows = HostWindows::new(recipe.batch(examples), recipe.unrolling(examples));
        Self { windows, spec: spec.clone() }
    }
}

impl CudaBackend {
    /// A training with its initial weights, on this GPU and those of other `ranks`, for batches of
    /// at most `points` points.
    ///
    /// # Errors
    /// If the kernels do not support the network, or the GPU's memory is too small.
    pub fn new(
        device: &Arc<Device>,
        model: &ModelConfig,
        config: &TrainConfig,
        points: usize,
        ranks: Option<Arc<Ranks>>,
    ) -> Result<Self, CudaError> {
        let precision = config.precision;
        // The capacity decides the order of sums, so it must be the same after a resume.
        let room = Capacity { points, edges: EDGES_PER_POINT * points };
        let averaging = config.ema > 0.0;
        let mut trainer = CudaTrainer::new(device, model, precision, room, averaging, ranks)?
            .with_loss(config.loss_floor as f32, config.loss_over != LossOver::Step);
        let width = model.width;
        let model = config.initial_network(model, &cpu());
        trainer.set_muon(&config.muon_matrices(&model, width))?;
        let start = weights(&model);
        let zeros = vec![0.0; start.len()];
        trainer.restore(&start, [&zeros, &zeros], averaging.then_some(&start[..]))?;
        Ok(Self {
            trainer,
            model,
            builder: None,
            over: config.loss_over,
            decay: config.ema,
            averaging,
            optimiser_steps: 0,
            step: 0,
            losses: Vec::new(),
            unread: 0,
            device: device.clone(),
        })
    }

    /// Continues from a state; `false` if it belongs to another network.
    ///
    /// # Errors
    /// If the GPU failed.
    pub fn resume(&mut self, state: &State) -> Result<bool, CudaError> {
        let (optimiser_steps, mean, square) = state.moments.parts();
        let average = state.average.as_deref();
        if average.is_some() != self.averaging {
            return Ok(false);
        }
        match self.trainer.restore(&state.weights, [mean, square], average) {
            Ok(()) => {}
            Err(CudaError::Weights { .. }) => return Ok(false),
            Err(error) => return Err(error),
        }
        (self.optimiser_steps, self.step) = (optimiser_steps, state.step);
        Ok(true)
    }

    /// Steps made.
    pub fn step_number(&self) -> u64 {
        self.step
    }

    /// The state after the last step. Waits for the device.
    ///
    /// # Errors
    /// If the GPU failed.
    pub fn state(&self) -> Result<State, CudaError> {
        let [weights, mean, square, average] = self.trainer.download()?;
        Ok(State {
            weights,
            moments: Moments::from_parts(self.optimiser_steps, mean, square),
            average: self.averaging.then_some(average),
            step: self.step,
        })
    }

    /// Queues one step at the learning rate `rate`.
    ///
    /// # Errors
    /// If the GPU failed or its memory is too small.
    pub fn step(&mut self, batch: &CudaBatch, rate: f64) -> Result<(), CudaError> {
        self.optimiser_steps += 1;
        self.step += 1;
        let [mean, square] = Moments::corrections(self.optimiser_steps);
        let rates = Rates {
            rate: rate as f32,
            corrections: [mean, square],
            decay: average_decay(self.decay, self.step),
        };
        let over = self.over;
        let (trainer, batch) = self.load(batch)?;
        let mut targets = Targets::of_all(&batch.targets, &batch.frames);
        if over == LossOver::Window {
            (targets.ends, targets.groups) = (&batch.window_ends, batch.windows);
        }
        trainer.step(&batch.frames, targets, rates)?;
        self.unread += 1;
        if self.unread == LOSSES {
            self.read_losses()?;
        }
        Ok(())
    }

    /// Normalised accelerations of a batch by the network in training. Waits for the device.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn predict(&mut self, batch: &CudaBatch) -> Result<Vec<f32>, CudaError> {
        let stream = self.device.stream().clone();
        let (trainer, batch) = self.load(batch)?;
        let output = trainer.predict(&batch.frames)?;
        Ok(stream.clone_dtoh(&output.slice(..batch.values))?)
    }

    /// Builds a batch on the GPU and makes room for it in the network. The step before may still
    /// run.
    fn load(&mut self, batch: &CudaBatch) -> Result<(&mut CudaTrainer, &DeviceBatch), CudaError> {
        let InputSpec { config, normalisation, bounds } = &*batch.spec;
        let device = &self.device;
        let builder = match &mut self.builder {
            Some(builder) => builder,
            none => none.insert(BatchBuilder::new(device, config, normalisation, bounds)?),
        };
        let trainer = &mut self.trainer;
        let batch = builder
            .make(&batch.windows, |input, predicted| trainer.predict_windows(input, predicted))?;
        trainer.grow(batch.capacity())?;
        Ok((trainer, batch))
    }

    fn read_losses(&mut self) -> Result<(), CudaError> {
        let new = self.trainer.losses(self.unread)?;
        self.losses.extend(new.into_iter().map(f64::from));
        self.unread = 0;
        Ok(())
    }

    /// The losses since the last call. Waits for the device.
    ///
    /// # Errors
    /// If the GPU failed.
    pub fn take_losses(&mut self) -> Result<Vec<f64>, CudaError> {
        self.read_losses()?;
        Ok(std::mem::take(&mut self.losses))
    }

    /// The GPU.
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// The network to use, with averaged weights if there are any.
    ///
    /// # Errors
    /// If the GPU failed.
    pub fn model(&self) -> Result<Model<Cpu>, CudaError> {
        let [weights, .., average] = self.trainer.download()?;
        let weights = if self.averaging { average } else { weights };
        Ok(with_weights(self.model.clone(), &weights))
    }
}
