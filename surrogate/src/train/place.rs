//! Where a training computes: the processor or a GPU.

use std::sync::Arc;

use dempm::device::Device;
use gpu::ranks::{Launch, Ranks};
use miette::IntoDiagnostic;

use super::config::TrainConfig;
use super::cuda::{CudaEngine, HostBatch};
use super::engine::{CpuEngine, Preparation, Prepared, State};
use super::ranks::AllReduce;
use crate::backend::Cpu;
use crate::config::ModelConfig;
use crate::data::Batch;
use crate::model::Model;

/// What computes the steps.
#[allow(clippy::large_enum_variant)] // there is one
pub enum Engine {
    Cpu(CpuEngine),
    Cuda(CudaEngine),
}

/// A batch for an engine.
pub enum EngineBatch {
    Cpu(Prepared),
    Cuda(HostBatch),
}

/// The GPU to compute on, `None` for the processor. Of several processes each takes one of its own.
///
/// # Errors
/// When a GPU that was asked for cannot be used.
pub fn open(device: Device, launch: &Launch) -> miette::Result<Option<Arc<gpu::Device>>> {
    let opened = match device {
        _ if !launch.is_shared() => device.open(),
        Device::Cpu => Ok(None),
        Device::Auto if gpu::Device::count() == 0 => Ok(None),
        _ => device.open_for_rank(launch.local_rank).map(Some),
    };
    opened.into_diagnostic()
}

impl Engine {
    /// A network with random weights, the same in all places, for batches of at most so many
    /// points; `ranks` are other GPUs that train it too.
    ///
    /// # Errors
    /// If the GPU cannot compute the network.
    pub fn new(
        device: Option<&Arc<gpu::Device>>,
        ranks: Option<Arc<Ranks>>,
        model: &ModelConfig,
        config: &TrainConfig,
        points: usize,
    ) -> miette::Result<Self> {
        let Some(device) = device else {
            return Ok(Self::Cpu(CpuEngine::new(model, config.seed, config.ema)));
        };
        let engine = CudaEngine::new(device, model, config, points, ranks);
        Ok(Self::Cuda(engine.into_diagnostic()?))
    }

    /// The GPU, if it is one that computes.
    pub fn gpu(&self) -> Option<Arc<gpu::Device>> {
        match self {
            Self::Cpu(_) => None,
            Self::Cuda(engine) => Some(engine.device().clone()),
        }
    }

    /// What makes batches for this engine.
    pub fn prepare(
        &self,
        preparation: &Preparation,
    ) -> impl Fn(Batch) -> EngineBatch + Send + Sync + 'static {
        let on_gpu = matches!(self, Self::Cuda(_));
        let preparation = preparation.clone();
        move |batch| {
            if on_gpu {
                EngineBatch::Cuda(HostBatch::new(batch, &preparation))
            } else {
                EngineBatch::Cpu(preparation.prepare(&batch))
            }
        }
    }

    /// Continues from a state; `false` if it is that of another network.
    ///
    /// # Errors
    /// If the GPU failed.
    pub fn resume(&mut self, state: State) -> miette::Result<bool> {
        match self {
            Self::Cpu(engine) => Ok(engine.resume(state)),
            Self::Cuda(engine) => engine.resume(&state).into_diagnostic(),
        }
    }

    /// Steps made.
    pub fn step_number(&self) -> u64 {
        match self {
            Self::Cpu(engine) => engine.state().step,
            Self::Cuda(engine) => engine.step_number(),
        }
    }

    /// Where the training is.
    ///
    /// # Errors
    /// If the GPU failed.
    pub fn state(&self) -> miette::Result<State> {
        match self {
            Self::Cpu(engine) => Ok(engine.state().clone()),
            Self::Cuda(engine) => engine.state().into_diagnostic(),
        }
    }

    /// One step on a batch of [`prepare`](Self::prepare), together with other processes; those on
    /// GPUs have been known from the start.
    ///
    /// # Errors
    /// If the GPU failed, or another rank is gone.
    pub fn step(
        &mut self,
        batch: EngineBatch,
        rate: f64,
        ranks: &mut dyn AllReduce,
    ) -> miette::Result<()> {
        match (self, batch) {
            (Self::Cpu(engine), EngineBatch::Cpu(batch)) => engine.step(batch, rate, ranks)?,
            (Self::Cuda(engine), EngineBatch::Cuda(batch)) => {
                engine.step(&batch, rate).into_diagnostic()?;
            }
            _ => unreachable!("batches are made for their engine"),
        }
        Ok(())
    }

    /// The losses since this was last asked for. Reading waits for the device, so do it rarely.
    ///
    /// # Errors
    /// If the GPU failed.
    pub fn take_losses(&mut self) -> miette::Result<Vec<f64>> {
        match self {
            Self::Cpu(engine) => Ok(engine.take_losses()),
            Self::Cuda(engine) => engine.take_losses().into_diagnostic(),
        }
    }

    /// The network as it learns.
    ///
    /// # Errors
    /// If the GPU failed.
    pub fn network(&self) -> miette::Result<Model<Cpu>> {
        match self {
            Self::Cpu(engine) => Ok(engine.network()),
            Self::Cuda(engine) => engine.network().into_diagnostic(),
        }
    }

    /// The network to use: with averaged weights if there are any.
    ///
    /// # Errors
    /// If the GPU failed.
    pub fn model(&self) -> miette::Result<Model<Cpu>> {
        match self {
            Self::Cpu(engine) => Ok(engine.model()),
            Self::Cuda(engine) => engine.model().into_diagnostic(),
        }
    }
}
