//! Training on a GPU.

use std::sync::Arc;

use cudarc::driver::CudaSlice;
use gpu::Device;

use super::adam::Adam;
use super::engine::{Preparation, Random, State, average_decay};
use super::parameters::{weights, with_weights};
use crate::backend::Cpu;
use crate::config::ModelConfig;
use crate::cuda::{
    BatchBuilder, Capacity, CudaError, CudaTrainer, DeviceBatch, FrameInput, HostInput,
    HostWindows, LOSSES, Precision, Rates, supports,
};
use crate::data::Batch;
use crate::features::{Window, host_frames};
use crate::model::Model;

/// The twin of [`CpuEngine`](super::engine::CpuEngine), with the same states.
pub struct CudaEngine {
    device: Arc<Device>,
    trainer: CudaTrainer,
    /// A network of this architecture, for its weights to be replaced.
    model: Model<Cpu>,
    /// Makes batches of windows.
    builder: Option<BatchBuilder>,
    /// Batches that come as graphs.
    frames: Vec<FrameInput>,
    target: CudaSlice<f32>,
    decay: f64,
    averaging: bool,
    adam_steps: u64,
    step: u64,
    /// Losses read, and number of those that wait on the device.
    losses: Vec<f64>,
    unread: usize,
}

/// A batch on the GPU, and the network that has room for it.
struct Loaded<'a> {
    trainer: &'a mut CudaTrainer,
    frames: &'a [FrameInput],
    targets: &'a CudaSlice<f32>,
}

/// A batch for a GPU.
pub enum HostBatch {
    /// As windows, whose graphs are built there.
    Windows(HostWindows, Box<Preparation>),
    /// As graphs, for networks with features that the GPU does not compute.
    Graphs { frames: Vec<HostInput>, targets: Vec<f32> },
}

impl HostBatch {
    /// Does what is not done on the GPU; may run ahead of the training on another thread.
    pub fn new(batch: Batch, preparation: &Preparation) -> Self {
        let Preparation { config, normalisation, bounds } = preparation;
        if supports(config).is_ok() {
            let windows = HostWindows::new(&batch.windows, batch.points, batch.targets);
            return Self::Windows(windows, Box::new(preparation.clone()));
        }
        let windows = batch.windows.iter().zip(&batch.points).zip(&batch.statics);
        let windows: Vec<Window> = windows
            .map(|((positions, &points), statics)| Window { positions, points, statics })
            .collect();
        let frames = host_frames(&windows, config, normalisation, bounds);
        let frames = frames.into_iter().map(HostInput::from).collect();
        Self::Graphs { frames, targets: batch.targets }
    }
}

impl CudaEngine {
    /// The network that [`CpuEngine::new`](super::engine::CpuEngine::new) gives, on a GPU.
    ///
    /// # Errors
    /// If the network is not one for the kernels, or the GPU's memory too small.
    pub fn new(
        device: &Arc<Device>,
        config: &ModelConfig,
        random: Random,
        decay: f64,
        precision: Precision,
    ) -> Result<Self, CudaError> {
        let model = random.model(config);
        let start = weights(&model);
        let averaging = decay > 0.0;
        let room = Capacity { points: 1, edges: 1 };
        let mut trainer = CudaTrainer::new(device, config, precision, room, averaging)?;
        let zeros = vec![0.0; start.len()];
        trainer.restore(&start, [&zeros, &zeros], averaging.then_some(&start[..]))?;
        Ok(Self {
            trainer,
            model,
            builder: None,
            frames: Vec::new(),
            target: device.zeros(1)?,
            decay,
            averaging,
            adam_steps: 0,
            step: 0,
            losses: Vec::new(),
            unread: 0,
            device: device.clone(),
        })
    }

    /// Continues from a state; `false` if it is that of another network.
    ///
    /// # Errors
    /// If the GPU failed.
    pub fn resume(&mut self, state: &State) -> Result<bool, CudaError> {
        let (adam_steps, mean, square) = state.adam.parts();
        let average = state.average.as_deref();
        if average.is_some() != self.averaging {
            return Ok(false);
        }
        match self.trainer.restore(&state.weights, [mean, square], average) {
            Ok(()) => {}
            Err(CudaError::Weights { .. }) => return Ok(false),
            Err(error) => return Err(error),
        }
        (self.adam_steps, self.step) = (adam_steps, state.step);
        Ok(true)
    }

    /// Steps made.
    pub fn step_number(&self) -> u64 {
        self.step
    }

    /// Where the training is. Waits for the device.
    ///
    /// # Errors
    /// If the GPU failed.
    pub fn state(&self) -> Result<State, CudaError> {
        let [weights, mean, square, average] = self.trainer.download()?;
        Ok(State {
            weights,
            adam: Adam::from_parts(self.adam_steps, mean, square),
            average: self.averaging.then_some(average),
            step: self.step,
        })
    }

    /// One step; does not wait for it.
    ///
    /// # Errors
    /// If the GPU failed or its memory is too small.
    pub fn step(&mut self, batch: &HostBatch, rate: f64) -> Result<(), CudaError> {
        self.adam_steps += 1;
        self.step += 1;
        let [mean, square] = Adam::corrections(self.adam_steps);
        let rates = Rates {
            rate: rate as f32,
            corrections: [mean, square],
            decay: average_decay(self.decay, self.step),
        };
        let Loaded { trainer, frames, targets } = self.load(batch)?;
        trainer.step(frames, targets, rates)?;
        self.unread += 1;
        if self.unread == LOSSES {
            self.read_losses()?;
        }
        Ok(())
    }

    /// Normalised accelerations that the network as it learns gives for a batch. Waits.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn predict(&mut self, batch: &HostBatch) -> Result<Vec<f32>, CudaError> {
        let stream = self.device.stream().clone();
        let Loaded { trainer, frames, .. } = self.load(batch)?;
        let values = frames[0].graph.points * trainer.network().dimensions();
        let output = trainer.network().forward(frames)?;
        Ok(stream.clone_dtoh(&output.slice(..values))?)
    }

    /// Brings a batch to the GPU and makes room for it in the network.
    fn load(&mut self, batch: &HostBatch) -> Result<Loaded<'_>, CudaError> {
        match batch {
            HostBatch::Windows(windows, preparation) => {
                let Preparation { config, normalisation, bounds } = preparation.as_ref();
                let device = &self.device;
                let builder = self.builder.get_or_insert_with(|| {
                    BatchBuilder::new(device, config, normalisation, bounds)
                });
                let DeviceBatch { frames, targets } = builder.make(windows)?;
                let graph = &frames[0].graph;
                self.trainer.grow(Capacity { points: graph.points, edges: graph.capacity })?;
                Ok(Loaded { trainer: &mut self.trainer, frames, targets })
            }
            HostBatch::Graphs { frames, targets } => {
                self.make_room(frames, targets)?;
                for (frame, host) in self.frames.iter_mut().zip(frames) {
                    frame.fill(&self.device, host)?;
                }
                let mut target = self.target.slice_mut(..targets.len());
                self.device.stream().memcpy_htod(targets, &mut target)?;
                let Self { trainer, frames, target, .. } = self;
                Ok(Loaded { trainer, frames, targets: target })
            }
        }
    }

    fn make_room(&mut self, batch: &[HostInput], targets: &[f32]) -> Result<(), CudaError> {
        let most = |count: fn(&HostInput) -> usize| batch.iter().map(count).max();
        let points = most(|frame| frame.points).unwrap_or(0);
        let edges = most(|frame| frame.sender.len()).unwrap_or(0);
        let old = self.trainer.network().capacity();
        if self.frames.len() == batch.len() && points <= old.points && edges <= old.edges {
            return Ok(());
        }
        // Columns fall and spread, so the next batch may well have more.
        let room = |needed: usize, old| if needed > old { needed + needed / 4 } else { old };
        let new = Capacity { points: points.max(old.points), edges: room(edges, old.edges) };
        self.frames.clear();
        self.trainer.grow(new)?;
        let Capacity { points, edges } = self.trainer.network().capacity();
        for host in batch {
            self.frames.push(FrameInput::with_room(&self.device, points, edges, host.columns)?);
        }
        let components = targets.len() / batch[0].points.max(1);
        self.target = self.device.zeros(points * components)?;
        Ok(())
    }

    fn read_losses(&mut self) -> Result<(), CudaError> {
        let new = self.trainer.losses(self.unread)?;
        self.losses.extend(new.into_iter().map(f64::from));
        self.unread = 0;
        Ok(())
    }

    /// The losses since this was last asked for. Waits for the device.
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

    /// The network to use: with averaged weights if there are any.
    ///
    /// # Errors
    /// If the GPU failed.
    pub fn model(&self) -> Result<Model<Cpu>, CudaError> {
        let [weights, .., average] = self.trainer.download()?;
        let weights = if self.averaging { average } else { weights };
        Ok(with_weights(self.model.clone(), &weights))
    }
}
