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
            return Ok(Self::Cpu(CpuEngine::new(model, config)));
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

    /// Normalised accelerations that the network as it learns gives for a batch of
    /// [`prepare`](Self::prepare). Waits for the device.
    ///
    /// # Errors
    /// If the GPU failed.
    pub fn predict(&mut self, batch: &EngineBatch) -> miette::Result<Vec<f32>> {
        match (self, batch) {
            (Self::Cpu(engine), EngineBatch::Cpu(batch)) => Ok(engine.predict(batch)),
            (Self::Cuda(engine), EngineBatch::Cuda(batch)) => {
                engine.predict(batch).into_diagnostic()
            }
            _ => unreachable!("batches are made for their engine"),
        }
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
    use super::super::ranks::Alone;
    use super::*;
    use crate::features::Normalisation;

    /// Both engines start from the same weights, so they say the same of a batch; and what they
    /// say is what they are judged by in the next step.
    #[test]
    fn engines_predict_alike_and_are_judged_by_it() {
        let model = ModelConfig { width: 16, frames: 3, ..Default::default() };
        let config = TrainConfig { seed: 3, loss_floor: 0.7, ..TrainConfig::default() };
        let normalisation = Normalisation::about_zero(2, 0.01, 1.0);
        let preparation =
            Preparation { config: model.clone(), normalisation, bounds: [[0.0, 1.0]; 2] };
        let points = [40, 25];
        let window = |&points: &usize| {
            let at = |k: usize| 0.5 + 0.45 * (1.7 * (k % (2 * points)) as f32).sin();
            (0..6 * points).map(|k| at(k) + 1e-4 * (k as f32).cos()).collect()
        };
        let batch = Batch {
            windows: points.iter().map(window).collect(),
            points: points.to_vec(),
            statics: vec![Vec::new(); 2],
            obstacles: vec![Vec::new(); 2],
            targets: (0..130).map(|k| (k as f32).cos()).collect(),
        };
        let loss = |said: &[f32]| {
            let square = |x: f32| f64::from(x).powi(2);
            let errors: f64 = said.iter().zip(&batch.targets).map(|(a, b)| square(a - b)).sum();
            errors / batch.targets.iter().map(|&b| square(b) + 0.7 * 0.7).sum::<f64>()
        };
        let mut engines = vec![Engine::Cpu(CpuEngine::new(&model, &config))];
        if let Some(device) = gpu::for_tests() {
            let engine = CudaEngine::new(&device, &model, &config, 65, None);
            engines.push(Engine::Cuda(engine.unwrap()));
        }
        let mut first: Option<Vec<f32>> = None;
        for mut engine in engines {
            let prepare = engine.prepare(&preparation);
            let said = engine.predict(&prepare(batch.clone())).unwrap();
            engine.step(prepare(batch.clone()), 1e-3, &mut Alone).unwrap();
            let judged = engine.take_losses().unwrap();
            assert!((judged[0] / loss(&said) - 1.0).abs() < 1e-4, "{judged:?} {}", loss(&said));
            // 22 bits of precision through some ten layers.
            let other = first.get_or_insert_with(|| said.clone());
            assert_eq!(other.len(), said.len());
            for (a, b) in other.iter().zip(&said) {
                assert!((a - b).abs() < 1e-4, "{a} {b}");
            }
        }
    }
}
