//! Where a training runs: on the CPU or on a GPU.

use std::sync::Arc;

use dempm::device::Device;
use gpu::ranks::{Environment, Ranks};

use super::all_reduce::AllReduce;
use super::burn::BurnBackend;
use super::config::TrainConfig;
use super::cuda::{CudaBackend, CudaBatch};
use super::input::{BurnBatch, InputSpec};
use super::state::State;
use crate::cuda::CudaError;
#[cfg(feature = "burn-cuda")]
use crate::cuda::supports;
use crate::data::{Examples, Recipe};
#[cfg(feature = "burn-cuda")]
use crate::network::Precision;
use crate::network::burn_backend::{Cpu, CpuAutodiff, device as cpu};
#[cfg(feature = "burn-cuda")]
use crate::network::burn_backend::{GpuAutodiff, GpuDevice, gpu_device};
use crate::network::{Model, ModelConfig};

/// Computes the training steps.
#[allow(clippy::large_enum_variant)] // there is one
pub enum Backend {
    /// With Burn on the CPU.
    Cpu(BurnBackend<CpuAutodiff>),
    /// With Burn on a GPU.
    #[cfg(feature = "burn-cuda")]
    BurnCuda(BurnBackend<GpuAutodiff>),
    /// With kernels of our own.
    Cuda(CudaBackend),
}

/// A batch for a backend of the same kind.
#[allow(clippy::large_enum_variant)] // boxed where many wait
pub enum BackendBatch {
    /// Tensors.
    Cpu(BurnBatch<CpuAutodiff>),
    /// Tensors on a GPU.
    #[cfg(feature = "burn-cuda")]
    BurnCuda(BurnBatch<GpuAutodiff>),
    /// Positions and targets.
    Cuda(CudaBatch),
}

/// The GPU to train on, or `None` for the CPU. Several processes take a GPU each.
///
/// # Errors
/// If a GPU that was asked for cannot be used.
pub fn open_device(
    device: Device,
    environment: &Environment,
) -> Result<Option<Arc<gpu::Device>>, gpu::Error> {
    match device {
        _ if !environment.is_shared() => device.open(),
        Device::Cpu => Ok(None),
        Device::Auto if gpu::Device::count() == 0 => Ok(None),
        _ => device.open_for_rank(environment.local_rank).map(Some),
    }
}

impl Backend {
    /// A training with its initial weights, the same on every device, for batches of at most
    /// `points` points. `ranks` are the other GPUs that take part.
    ///
    /// On a GPU kernels of our own compute it; what they do not support, Burn, if that is compiled in
    /// (`burn-cuda`).
    ///
    /// # Errors
    /// If the GPU does not support the network.
    pub fn new(
        device: Option<&Arc<gpu::Device>>,
        ranks: Option<Arc<Ranks>>,
        model: &ModelConfig,
        config: &TrainConfig,
        points: usize,
    ) -> Result<Self, CudaError> {
        let Some(device) = device else {
            return Ok(Self::Cpu(BurnBackend::new(cpu(), model, config)));
        };
        #[cfg(feature = "burn-cuda")]
        if config.precision == Precision::F32 && supports(model).is_err() {
            let backend = BurnBackend::new(gpu_device(device), model, config);
            return Ok(Self::BurnCuda(backend));
        }
        Ok(Self::Cuda(CudaBackend::new(device, model, config, points, ranks)?))
    }

    /// The GPU, if the training runs on one with kernels of our own.
    pub fn gpu(&self) -> Option<Arc<gpu::Device>> {
        match self {
            Self::Cuda(backend) => Some(backend.device().clone()),
            _ => None,
        }
    }

    /// The GPU, if Burn trains on one.
    #[cfg(feature = "burn-cuda")]
    pub fn burn_gpu(&self) -> Option<GpuDevice> {
        match self {
            Self::BurnCuda(backend) => Some(backend.device().clone()),
            _ => None,
        }
    }

    /// Whether [`step`](Self::step) unrolls windows by itself (pushforward).
    pub fn unrolls(&self) -> bool {
        matches!(self, Self::Cuda(_))
    }

    /// Returns the function that makes batches for this backend, on any thread.
    pub fn prepare(
        &self,
        spec: &InputSpec,
    ) -> impl Fn(&Recipe, &Examples) -> BackendBatch + Send + Sync + 'static {
        let processor = match self {
            Self::Cpu(backend) => Some(*backend.device()),
            _ => None,
        };
        #[cfg(feature = "burn-cuda")]
        let burn_gpu = self.burn_gpu();
        let spec = Arc::new(spec.clone());
        move |recipe, examples| {
            if let Some(device) = &processor {
                return BackendBatch::Cpu(spec.build(&recipe.batch(examples), device));
            }
            #[cfg(feature = "burn-cuda")]
            if let Some(device) = &burn_gpu {
                return BackendBatch::BurnCuda(spec.build(&recipe.batch(examples), device));
            }
            BackendBatch::Cuda(CudaBatch::new(recipe, examples, &spec))
        }
    }

    /// Continues from a state; `false` if it belongs to another network.
    ///
    /// # Errors
    /// If the GPU failed.
    pub fn resume(&mut self, state: State) -> Result<bool, CudaError> {
        match self {
            Self::Cpu(backend) => Ok(backend.resume(state)),
            #[cfg(feature = "burn-cuda")]
            Self::BurnCuda(backend) => Ok(backend.resume(state)),
            Self::Cuda(backend) => backend.resume(&state),
        }
    }

    /// Steps made.
    pub fn step_number(&self) -> u64 {
        match self {
            Self::Cpu(backend) => backend.state().step,
            #[cfg(feature = "burn-cuda")]
            Self::BurnCuda(backend) => backend.state().step,
            Self::Cuda(backend) => backend.step_number(),
        }
    }

    /// The state after the last step.
    ///
    /// # Errors
    /// If the GPU failed.
    pub fn state(&self) -> Result<State, CudaError> {
        match self {
            Self::Cpu(backend) => Ok(backend.state().clone()),
            #[cfg(feature = "burn-cuda")]
            Self::BurnCuda(backend) => Ok(backend.state().clone()),
            Self::Cuda(backend) => backend.state(),
        }
    }

    /// One step on a batch of [`prepare`](Self::prepare) at the learning rate `rate`. Gradients are
    /// summed over `ranks` on the CPU; GPUs sum over those of [`new`](Self::new).
    ///
    /// # Errors
    /// If the GPU failed, or another rank is gone.
    pub fn step(
        &mut self,
        batch: BackendBatch,
        rate: f64,
        ranks: &mut dyn AllReduce,
    ) -> Result<(), CudaError> {
        match (self, batch) {
            (Self::Cpu(backend), BackendBatch::Cpu(batch)) => backend.step(batch, rate, ranks)?,
            #[cfg(feature = "burn-cuda")]
            (Self::BurnCuda(backend), BackendBatch::BurnCuda(batch)) => {
                backend.step(batch, rate, ranks)?;
            }
            (Self::Cuda(backend), BackendBatch::Cuda(batch)) => backend.step(&batch, rate)?,
            _ => unreachable!("batches are made for their backend"),
        }
        Ok(())
    }

    /// Normalised accelerations of a batch of [`prepare`](Self::prepare) by the network in training.
    /// Waits for the device.
    ///
    /// # Errors
    /// If the GPU failed.
    pub fn predict(&mut self, batch: &BackendBatch) -> Result<Vec<f32>, CudaError> {
        match (self, batch) {
            (Self::Cpu(backend), BackendBatch::Cpu(batch)) => Ok(backend.predict(batch)),
            #[cfg(feature = "burn-cuda")]
            (Self::BurnCuda(backend), BackendBatch::BurnCuda(batch)) => Ok(backend.predict(batch)),
            (Self::Cuda(backend), BackendBatch::Cuda(batch)) => backend.predict(batch),
            _ => unreachable!("batches are made for their backend"),
        }
    }

    /// The losses since the last call. Waits for the device, so call it rarely.
    ///
    /// # Errors
    /// If the GPU failed.
    pub fn take_losses(&mut self) -> Result<Vec<f64>, CudaError> {
        match self {
            Self::Cpu(backend) => Ok(backend.take_losses()),
            #[cfg(feature = "burn-cuda")]
            Self::BurnCuda(backend) => Ok(backend.take_losses()),
            Self::Cuda(backend) => backend.take_losses(),
        }
    }

    /// The network to use, with averaged weights if there are any.
    ///
    /// # Errors
    /// If the GPU failed.
    pub fn model(&self) -> Result<Model<Cpu>, CudaError> {
        match self {
            Self::Cpu(backend) => Ok(backend.model()),
            #[cfg(feature = "burn-cuda")]
            Self::BurnCuda(backend) => Ok(backend.model()),
            Self::Cuda(backend) => backend.model(),
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::super::all_reduce::SingleProcess;
    use super::super::config::Optimiser;
    use super::super::optimiser::Moments;
    use super::*;
    use crate::data::{Example, Shard};
    use crate::features::Normalisation;
    use crate::network::Precision;

    fn spec() -> InputSpec {
        let config = ModelConfig { width: 16, frames: 3, ..Default::default() };
        let normalisation = Normalisation {
            acceleration_mean: vec![1e-4, -2e-4],
            ..Normalisation::about_zero(2, 0.01, 1e-3)
        };
        InputSpec { config, normalisation, bounds: [[0.0, 1.0]; 2] }
    }

    fn recipe() -> Recipe {
        Recipe {
            seed: 1,
            batch: 2,
            shard: Shard { rank: 0, ranks: 1 },
            alike: false,
            emphasis: 1,
            frames: 3,
            unroll: 5,
            unroll_from: 0,
            noise: 0.0,
            mirror: false,
            without_gravity: true,
            normalisation: spec().normalisation,
        }
    }

    /// Windows of 40 and `points` points, which the network unrolls by `unroll` steps.
    fn examples(unroll: usize, points: usize) -> Examples {
        let mut examples = Examples { windows: Vec::new(), future: Vec::new(), unroll };
        for (points, gravity) in [(40, [0.0, -1e-4]), (points, [5e-5, -1e-4])] {
            let at = |k: usize| {
                let start = |i: usize| 0.5 + 0.45 * (1.7 * i as f64).sin();
                let drift =
                    move |i: usize| 1e-3 * (k as f64 + 0.1 * (k * k) as f64) * (i as f64).cos();
                (0..2 * points).map(move |i| start(i) + drift(i))
            };
            examples.windows.push(Example {
                points,
                positions: (0..3).flat_map(at).collect(),
                next: at(3).collect(),
                gravity,
                statics: Vec::new(),
                obstacles: Vec::new(),
            });
            examples.future.push((3..9).flat_map(at).collect());
        }
        examples
    }

    /// Unrolls windows on the CPU, with the predictions of a backend.
    fn pushed(backend: &mut Backend, recipe: &Recipe, examples: Examples) -> Examples {
        let prepare = backend.prepare(&spec());
        let said = |examples: &Examples| {
            let still = Examples { unroll: 0, ..examples.clone() };
            let normalised = backend.predict(&prepare(recipe, &still))?;
            Ok::<_, CudaError>(recipe.accelerations(examples, &normalised))
        };
        examples.push_forward(said).unwrap()
    }

    /// Both backends start from the same weights, so their predictions agree; and the loss of the next
    /// step is that of the prediction.
    #[test]
    fn backends_agree_and_the_loss_is_that_of_the_prediction() {
        let (spec, recipe) = (spec(), recipe());
        let config = TrainConfig { seed: 3, loss_floor: 0.7, ..TrainConfig::default() };
        let batch = recipe.batch(&examples(0, 25));
        let loss = |said: &[f32]| {
            let square = |x: f32| f64::from(x).powi(2);
            let errors: f64 = said.iter().zip(&batch.targets).map(|(a, b)| square(a - b)).sum();
            errors / batch.targets.iter().map(|&b| square(b) + 0.7 * 0.7).sum::<f64>()
        };
        let mut backends = vec![Backend::Cpu(BurnBackend::new(cpu(), &spec.config, &config))];
        if let Some(device) = gpu::for_tests() {
            let backend = CudaBackend::new(&device, &spec.config, &config, 65, None);
            backends.push(Backend::Cuda(backend.unwrap()));
        }
        let mut first: Option<(Vec<f32>, f64)> = None;
        for mut backend in backends {
            let prepare = backend.prepare(&spec);
            let said = backend.predict(&prepare(&recipe, &examples(0, 25))).unwrap();
            backend.step(prepare(&recipe, &examples(0, 25)), 1e-3, &mut SingleProcess).unwrap();
            let mut moved = examples(2, 25);
            if !backend.unrolls() {
                moved = pushed(&mut backend, &recipe, moved);
            }
            backend.step(prepare(&recipe, &moved), 1e-3, &mut SingleProcess).unwrap();
            let judged = backend.take_losses().unwrap();
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

    /// Random momenta whose singular values span three orders of magnitude, a thousand times as large as
    /// the gradient: orthogonal factors amplify what rounding makes of the small ones.
    #[test]
    fn muon_makes_the_same_step_on_a_gpu() {
        for width in [16, 128] {
            let spec = InputSpec { config: ModelConfig { width, ..spec().config }, ..spec() };
            let config = TrainConfig { optimiser: Optimiser::Muon, ema: 0.5, ..Default::default() };
            let burn = BurnBackend::new(cpu(), &spec.config, &config);
            let start = burn.state().clone();
            let hidden = config.muon_matrices(&burn.model(), width);
            let rows: Vec<_> = hidden.iter().map(|matrix| matrix.rows / width).collect();
            assert!((1..=3).all(|times| rows.contains(&times)), "{rows:?}");
            let mut random = ChaCha8Rng::seed_from_u64(5);
            let count = start.weights.len();
            let mut mean: Vec<_> = (0..count).map(|_| random.random_range(-1e3..1e3)).collect();
            for matrix in &hidden {
                for (k, x) in mean[matrix.range()].iter_mut().enumerate() {
                    *x *= 1e-3_f32.powf((k % width) as f32 / width as f32);
                }
            }
            let square = vec![1e6; mean.len()];
            let moments = Moments::from_parts(9, mean, square);
            let before = State { moments, ..start };

            let mut backends = vec![Backend::Cpu(burn)];
            let Some(device) = gpu::for_tests() else { return };
            let backend = CudaBackend::new(&device, &spec.config, &config, 65, None);
            if let Err(error @ CudaError::Muon { .. }) = &backend {
                eprintln!("skipped: {error}");
                return;
            }
            backends.push(Backend::Cuda(backend.unwrap()));
            let after = backends.iter_mut().map(|backend| {
                assert!(backend.resume(before.clone()).unwrap());
                let batch = backend.prepare(&spec)(&recipe(), &examples(0, 25));
                backend.step(batch, 1e-3, &mut SingleProcess).unwrap();
                backend.state().unwrap()
            });
            let [expected, found] = after.collect::<Vec<_>>().try_into().unwrap();
            let distance = |a: &[f32], b: &[f32]| {
                a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt()
            };
            let error = |of: &dyn Fn(&State) -> Vec<f32>| {
                let [before, expected, found] = [&before, &expected, &found].map(of);
                distance(&expected, &found) / distance(&before, &expected)
            };
            // float32 has 3e-5 of these steps in weights of 0.1.
            for matrix in &hidden {
                let error = error(&|state| state.weights[matrix.range()].to_vec());
                assert!(error < 1e-3, "{width} {matrix:?}: {error:e}");
            }
            let error = [
                error(&|state| state.weights.clone()),
                error(&|state| state.moments.parts().1.to_vec()),
                error(&|state| state.average.clone().unwrap()),
            ];
            assert!(error.iter().all(|&error| error < 1e-3), "{width}: {error:?}");
        }
    }

    /// Batches of changing size, unrolled or not: a GPU that replays its recorded steps and unrolls
    /// windows by itself learns the same bits as one that starts afresh for each step, on windows
    /// unrolled by the CPU.
    #[test]
    fn a_gpu_repeats_steps_on_batches_of_any_size() {
        let Some(device) = gpu::for_tests() else { return };
        let (spec, recipe) = (spec(), recipe());
        for precision in [Precision::F32, Precision::Bf16] {
            let config = TrainConfig { precision, ema: 0.9, ..TrainConfig::default() };
            let backend = || {
                let made = CudaBackend::new(&device, &spec.config, &config, 100, None);
                Backend::Cuda(made.unwrap())
            };
            let mut repeating = backend();
            let (mut state, mut losses) = (repeating.state().unwrap(), Vec::new());
            let steps = [(0, 25), (0, 60), (2, 3), (0, 60), (5, 25), (1, 60), (0, 1), (2, 60)];
            for (unroll, points) in steps {
                let examples = examples(unroll, points);
                let batch = repeating.prepare(&spec)(&recipe, &examples);
                repeating.step(batch, 1e-3, &mut SingleProcess).unwrap();

                let mut fresh = backend();
                assert!(fresh.resume(state).unwrap());
                let examples = pushed(&mut fresh, &recipe, examples);
                let batch = fresh.prepare(&spec)(&recipe, &examples);
                fresh.step(batch, 1e-3, &mut SingleProcess).unwrap();
                losses.extend(fresh.take_losses().unwrap());
                state = fresh.state().unwrap();
            }
            assert_eq!(repeating.take_losses().unwrap(), losses);
            assert_eq!(repeating.state().unwrap(), state);
        }
    }
}
