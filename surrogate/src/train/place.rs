//! Where a training computes: the processor or a GPU.

use std::sync::Arc;

use dempm::device::Device;
use gpu::ranks::{Environment, Ranks};
use miette::IntoDiagnostic;

use super::config::TrainConfig;
use super::cuda::{CudaEngine, HostBatch};
use super::engine::{CpuEngine, Preparation, Prepared, State};
use super::ranks::AllReduce;
use crate::backend::Cpu;
use crate::config::ModelConfig;
use crate::data::{Draft, Recipe};
use crate::model::Model;

/// What computes the steps.
#[allow(clippy::large_enum_variant)] // there is one
pub enum Engine {
    Cpu(CpuEngine),
    Cuda(CudaEngine),
}

/// A batch for an engine.
#[allow(clippy::large_enum_variant)] // boxed where many wait
pub enum EngineBatch {
    Cpu(Prepared),
    Cuda(HostBatch),
}

/// The GPU to compute on, `None` for the processor. Of several processes each takes one of its own.
///
/// # Errors
/// When a GPU that was asked for cannot be used.
pub fn open(device: Device, environment: &Environment) -> miette::Result<Option<Arc<gpu::Device>>> {
    let opened = match device {
        _ if !environment.is_shared() => device.open(),
        Device::Cpu => Ok(None),
        Device::Auto if gpu::Device::count() == 0 => Ok(None),
        _ => device.open_for_rank(environment.local_rank).map(Some),
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

    /// Whether it moves windows on by itself before it learns from them (pushforward).
    pub fn pushes_forward(&self) -> bool {
        matches!(self, Self::Cuda(_))
    }

    /// What makes batches for this engine.
    pub fn prepare(
        &self,
        preparation: &Preparation,
    ) -> impl Fn(&Recipe, &Draft) -> EngineBatch + Send + Sync + 'static {
        let on_gpu = matches!(self, Self::Cuda(_));
        let preparation = Arc::new(preparation.clone());
        move |recipe, draft| {
            if on_gpu {
                EngineBatch::Cuda(HostBatch::new(recipe, draft, &preparation))
            } else {
                EngineBatch::Cpu(preparation.prepare(&recipe.batch(draft)))
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
    use super::super::config::Precision;
    use super::super::ranks::Alone;
    use super::*;
    use crate::data::{Example, Shard};
    use crate::features::Normalisation;

    fn preparation() -> Preparation {
        let config = ModelConfig { width: 16, frames: 3, ..Default::default() };
        let normalisation = Normalisation {
            acceleration_mean: vec![1e-4, -2e-4],
            ..Normalisation::about_zero(2, 0.01, 1e-3)
        };
        Preparation { config, normalisation, bounds: [[0.0, 1.0]; 2] }
    }

    fn recipe() -> Recipe {
        Recipe {
            seed: 1,
            batch: 2,
            shard: Shard { rank: 0, ranks: 1 },
            alike: false,
            frames: 3,
            unroll: 5,
            unroll_from: 0,
            noise: 0.0,
            mirror: false,
            without_gravity: true,
            normalisation: preparation().normalisation,
        }
    }

    /// Windows of 40 and some more points that the network is to move on.
    fn draft(unroll: usize, points: usize) -> Draft {
        let mut draft = Draft { examples: Vec::new(), future: Vec::new(), unroll };
        for (points, gravity) in [(40, [0.0, -1e-4]), (points, [5e-5, -1e-4])] {
            let at = |k: usize| {
                let start = |i: usize| 0.5 + 0.45 * (1.7 * i as f64).sin();
                let drift =
                    move |i: usize| 1e-3 * (k as f64 + 0.1 * (k * k) as f64) * (i as f64).cos();
                (0..2 * points).map(move |i| start(i) + drift(i))
            };
            draft.examples.push(Example {
                points,
                positions: (0..3).flat_map(at).collect(),
                next: at(3).collect(),
                gravity,
                statics: Vec::new(),
                obstacles: Vec::new(),
            });
            draft.future.push((3..9).flat_map(at).collect());
        }
        draft
    }

    /// Moves windows on the processor, with what an engine says.
    fn pushed(engine: &mut Engine, recipe: &Recipe, draft: Draft) -> Draft {
        let prepare = engine.prepare(&preparation());
        let said = |draft: &Draft| {
            let still = Draft { unroll: 0, ..draft.clone() };
            let normalised = engine.predict(&prepare(recipe, &still))?;
            Ok::<_, miette::Report>(recipe.accelerations(draft, &normalised))
        };
        draft.push_forward(said).unwrap()
    }

    /// Both engines start from the same weights, so they say the same of a batch; and what they
    /// say is what they are judged by in the next step.
    #[test]
    fn engines_predict_alike_and_are_judged_by_it() {
        let (preparation, recipe) = (preparation(), recipe());
        let config = TrainConfig { seed: 3, loss_floor: 0.7, ..TrainConfig::default() };
        let batch = recipe.batch(&draft(0, 25));
        let loss = |said: &[f32]| {
            let square = |x: f32| f64::from(x).powi(2);
            let errors: f64 = said.iter().zip(&batch.targets).map(|(a, b)| square(a - b)).sum();
            errors / batch.targets.iter().map(|&b| square(b) + 0.7 * 0.7).sum::<f64>()
        };
        let mut engines = vec![Engine::Cpu(CpuEngine::new(&preparation.config, &config))];
        if let Some(device) = gpu::for_tests() {
            let engine = CudaEngine::new(&device, &preparation.config, &config, 65, None);
            engines.push(Engine::Cuda(engine.unwrap()));
        }
        let mut first: Option<(Vec<f32>, f64)> = None;
        for mut engine in engines {
            let prepare = engine.prepare(&preparation);
            let said = engine.predict(&prepare(&recipe, &draft(0, 25))).unwrap();
            engine.step(prepare(&recipe, &draft(0, 25)), 1e-3, &mut Alone).unwrap();
            let mut moved = draft(2, 25);
            if !engine.pushes_forward() {
                moved = pushed(&mut engine, &recipe, moved);
            }
            engine.step(prepare(&recipe, &moved), 1e-3, &mut Alone).unwrap();
            let judged = engine.take_losses().unwrap();
            assert!((judged[0] / loss(&said) - 1.0).abs() < 1e-4, "{judged:?} {}", loss(&said));
            // 22 bits of precision through some ten layers.
            let (other, other_judged) = first.get_or_insert_with(|| (said.clone(), judged[1]));
            assert_eq!(other.len(), said.len());
            for (a, b) in other.iter().zip(&said) {
                assert!((a - b).abs() < 1e-4, "{a} {b}");
            }
            assert!((judged[1] / *other_judged - 1.0).abs() < 1e-4, "{judged:?} {other_judged}");
        }
    }

    /// Batches of changing size, windows moved on or not: a GPU that repeats its queued steps and
    /// moves windows by itself learns the same bits as one that does each step anew, on windows that
    /// the processor has moved.
    #[test]
    fn a_gpu_repeats_steps_on_batches_of_any_size() {
        let Some(device) = gpu::for_tests() else { return };
        let (preparation, recipe) = (preparation(), recipe());
        for precision in [Precision::F32, Precision::Bf16] {
            let config = TrainConfig { precision, ema: 0.9, ..TrainConfig::default() };
            let engine = || {
                let made = CudaEngine::new(&device, &preparation.config, &config, 100, None);
                Engine::Cuda(made.unwrap())
            };
            let mut repeating = engine();
            let (mut state, mut losses) = (repeating.state().unwrap(), Vec::new());
            let steps = [(0, 25), (0, 60), (2, 3), (0, 60), (5, 25), (1, 60), (0, 1), (2, 60)];
            for (unroll, points) in steps {
                let draft = draft(unroll, points);
                let batch = repeating.prepare(&preparation)(&recipe, &draft);
                repeating.step(batch, 1e-3, &mut Alone).unwrap();

                let mut fresh = engine();
                assert!(fresh.resume(state).unwrap());
                let draft = pushed(&mut fresh, &recipe, draft);
                let batch = fresh.prepare(&preparation)(&recipe, &draft);
                fresh.step(batch, 1e-3, &mut Alone).unwrap();
                losses.extend(fresh.take_losses().unwrap());
                state = fresh.state().unwrap();
            }
            assert_eq!(repeating.take_losses().unwrap(), losses);
            assert_eq!(repeating.state().unwrap(), state);
        }
    }
}
