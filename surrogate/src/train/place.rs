//! Where a training computes: the processor or a GPU.

use std::str::FromStr;

use gpu::Device;
use miette::IntoDiagnostic;

use super::cuda::{CudaEngine, HostBatch};
use super::engine::{CpuEngine, Prepared, State, prepare};
use crate::backend::Cpu;
use crate::config::ModelConfig;
use crate::cuda::Precision;
use crate::data::Batch;
use crate::features::Normalisation;
use crate::model::Model;

/// What the user asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The first GPU if there is one, else the processor.
    Auto,
    Cpu,
    /// GPU number n.
    Cuda(usize),
}

impl FromStr for Place {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let wrong = || "must be auto, cpu, cuda or cuda:N".to_owned();
        match text {
            "auto" => Ok(Self::Auto),
            "cpu" => Ok(Self::Cpu),
            "cuda" => Ok(Self::Cuda(0)),
            _ => {
                let number = text.strip_prefix("cuda:").ok_or_else(wrong)?;
                Ok(Self::Cuda(number.parse().map_err(|_| wrong())?))
            }
        }
    }
}

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

impl Engine {
    /// A network with random weights, the same in all places. `decay` is that of the moving
    /// average of the weights, 0 for none.
    ///
    /// # Errors
    /// If the place cannot compute the network.
    pub fn new(
        place: Place,
        precision: Precision,
        config: &ModelConfig,
        seed: u64,
        decay: f64,
    ) -> miette::Result<Self> {
        let device = match place {
            Place::Cpu => None,
            Place::Auto => Device::new(0).ok(),
            Place::Cuda(number) => Some(Device::new(number).into_diagnostic()?),
        };
        let Some(device) = device else {
            return Ok(Self::Cpu(CpuEngine::new(config, seed, decay)));
        };
        eprintln!("on {}", device.name());
        let engine = CudaEngine::new(&device, config, seed, decay, precision).into_diagnostic()?;
        Ok(Self::Cuda(engine))
    }

    /// What makes batches for this engine.
    pub fn preparation(
        &self,
        config: ModelConfig,
        normalisation: Normalisation,
        bounds: Vec<[f64; 2]>,
    ) -> impl Fn(Batch) -> EngineBatch + Send + Sync + 'static {
        let on_gpu = matches!(self, Self::Cuda(_));
        move |batch| {
            if on_gpu {
                EngineBatch::Cuda(HostBatch::new(batch, &config, &normalisation, &bounds))
            } else {
                EngineBatch::Cpu(prepare(&batch, &config, &normalisation, &bounds))
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

    /// One step on a batch of [`preparation`](Self::preparation).
    ///
    /// # Errors
    /// If the GPU failed.
    pub fn step(&mut self, batch: EngineBatch, rate: f64) -> miette::Result<()> {
        match (self, batch) {
            (Self::Cpu(engine), EngineBatch::Cpu(batch)) => engine.step(batch, rate),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places() {
        for (text, place) in [
            ("auto", Place::Auto),
            ("cpu", Place::Cpu),
            ("cuda", Place::Cuda(0)),
            ("cuda:3", Place::Cuda(3)),
        ] {
            assert_eq!(text.parse(), Ok(place));
        }
        for text in ["", "gpu", "cuda:", "cuda:x", "cuda3"] {
            assert!(text.parse::<Place>().is_err(), "{text}");
        }
    }
}
