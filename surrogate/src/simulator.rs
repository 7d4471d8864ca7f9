//! A trained network with everything it takes to use it.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use files::{WriteError, write_atomically};
use serde::{Deserialize, Serialize};

use crate::cuda::{self, CudaError};
use crate::diagnostics::{Accuracy, ErrorModel, TrainingRange};
use crate::features::{Normalisation, Window, mirrored, window_input};
use crate::inference::Inference;
use crate::network::burn_backend::{Cpu, Device, device};
#[cfg(feature = "burn-cuda")]
use crate::network::burn_backend::{GpuDevice, gpu_device};
use crate::network::weights::{self, WeightsError};
use crate::network::{Model, ModelConfig, Precision, is_zero};

/// Relative difference of times that is rounding.
pub(crate) const ROUNDING: f64 = 1e-6;

/// What a model was trained on; stored with its weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Training {
    /// Time between frames, s.
    pub frame_interval: f64,
    /// Whether it predicts accelerations relative to free fall.
    pub without_gravity: bool,
    /// Largest number of frames of a window before the first frame of a run.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub before_start: usize,
    /// Training steps made.
    pub steps: u64,
    /// Kind of material of the scenes it learnt from, as in scenes; none if they differ, and in older files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// Range of the training data; older files do not state it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<TrainingRange>,
    /// Errors on unseen runs; none if not measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<Accuracy>,
    /// Predicts its errors; none if not calibrated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<ErrorModel>,
}

impl Training {
    /// Of an untrained network whose windows lie within runs.
    pub fn untrained(frame_interval: f64, without_gravity: bool) -> Self {
        Self {
            frame_interval,
            without_gravity,
            before_start: 0,
            steps: 0,
            material: None,
            range: None,
            accuracy: None,
            error: None,
        }
    }

    /// Whether `interval` (s) is the time between frames in training, up to rounding.
    pub fn is_interval(&self, interval: f64) -> bool {
        (interval - self.frame_interval).abs() <= ROUNDING * self.frame_interval
    }
}

/// A network that predicts accelerations.
#[derive(Clone)]
pub struct Simulator {
    /// The network.
    pub model: Model<Cpu>,
    /// Its architecture.
    pub config: ModelConfig,
    /// Normalisation of its inputs and outputs.
    pub normalisation: Normalisation,
    /// What it was trained on.
    pub training: Training,
    /// Whether to average each prediction with that of the mirrored window.
    pub mirror: bool,
    /// The device of Burn.
    pub device: Device,
    /// The GPU for rollouts; none for the CPU.
    pub gpu: Option<Arc<gpu::Device>>,
    /// The GPU on which Burn computes rollouts, of networks that the kernels do not support.
    #[cfg(feature = "burn-cuda")]
    pub burn_gpu: Option<GpuDevice>,
    /// Precision on the GPU; `F32` gives the results of the CPU up to rounding.
    pub precision: Precision,
}

/// A model file that cannot be used.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum SimulatorError {
    /// Not a weights file, or a damaged one.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// The file cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
    /// The file does not state what the network was trained on.
    #[error("{path}: `extra.{KEY}` in the metadata is missing or damaged")]
    #[diagnostic(help("`surrogate train` writes it; docs/weights.md describes it"))]
    Training {
        /// The model file.
        path: String,
    },
}

/// Key of [`Training`] in the metadata of a weights file.
const KEY: &str = "training";

impl Simulator {
    /// A simulator on the CPU that does not average mirror images.
    pub fn new(
        model: Model<Cpu>,
        config: ModelConfig,
        normalisation: Normalisation,
        training: Training,
    ) -> Self {
        Self {
            model,
            config,
            normalisation,
            training,
            mirror: false,
            device: device(),
            gpu: None,
            #[cfg(feature = "burn-cuda")]
            burn_gpu: None,
            precision: Precision::F32,
        }
    }

    /// Loads a model file.
    ///
    /// # Errors
    /// If the file cannot be read or is damaged.
    pub fn load(path: &Path) -> Result<Self, SimulatorError> {
        let (model, config, normalisation, extra) = weights::load(path, &device())?;
        let training = extra.get(KEY).and_then(|text| serde_json::from_str(text).ok());
        let training = training
            .ok_or_else(|| SimulatorError::Training { path: path.display().to_string() })?;
        Ok(Self::new(model, config, normalisation, training))
    }

    /// Writes the model file, whole or not at all.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), SimulatorError> {
        let training = serde_json::to_string(&self.training)
            .map_err(|_| SimulatorError::Training { path: path.display().to_string() })?;
        write_atomically(path, |temporary| {
            let extra = BTreeMap::from([(KEY.to_owned(), training)]);
            Ok(weights::save(temporary, &self.model, &self.config, &self.normalisation, extra)?)
        })
    }

    /// Selects the device of rollouts. A network that the kernels do not support is computed by Burn on the
    /// GPU if that is compiled in (`burn-cuda`). Otherwise it stays on the CPU with `auto`; returns why if
    /// there is a GPU.
    ///
    /// # Errors
    /// If a GPU is asked for that cannot be used, or not for this network, or bf16 without a GPU.
    pub fn select_device(
        &mut self,
        choice: dempm::device::Device,
    ) -> Result<Option<CudaError>, CudaError> {
        use dempm::device::Device;
        #[cfg(feature = "burn-cuda")]
        if self.precision == Precision::F32 && cuda::supports(&self.config).is_err() {
            self.gpu = None;
            self.burn_gpu = choice.open()?.as_deref().map(gpu_device);
            return Ok(None);
        }
        let mut unsupported = None;
        self.gpu = match (choice, cuda::supports(&self.config)) {
            (Device::Auto, Err(reason)) => {
                unsupported = Some(reason).filter(|_| gpu::Device::count() > 0);
                None
            }
            (Device::Cuda(_), Err(reason)) => return Err(reason),
            _ => choice.open()?,
        };
        if self.gpu.is_none() && self.precision == Precision::Bf16 {
            return Err(CudaError::Bf16OnCpu);
        }
        if let Some(gpu) = &self.gpu {
            cuda::compile_ahead(gpu, self.precision)?;
        }
        Ok(unsupported)
    }

    /// Frames of a run that a rollout starts from: a window without those before the run.
    pub fn first_frames(&self) -> usize {
        self.config.window().saturating_sub(self.training.before_start).max(1)
    }

    /// The network for inference without the kernels; on the CPU it keeps encodings of frames.
    pub fn inference(&self) -> Inference {
        #[cfg(feature = "burn-cuda")]
        if let Some(device) = &self.burn_gpu {
            return Inference::on_gpu(&self.model, &self.config, device.clone());
        }
        let windows = if self.mirror { 2 } else { 1 };
        Inference::new(&self.model, &self.config, windows)
    }

    /// Accelerations of the points of a window (m/frame², x and y in turn). `gravity` is in
    /// m/frame², `domain` is the size of the domain (m).
    ///
    /// With `mirror`, a(X) becomes (a(X) + M a(M X)) / 2 with the reflection M of left and right, so
    /// that the mirrored window has the mirrored accelerations, whatever the network has learnt.
    pub fn accelerations(
        &self,
        network: &mut Inference,
        window: &Window,
        domain: [f64; 2],
        gravity: [f64; 2],
    ) -> Vec<f64> {
        let straight = self.predict(network, window, domain, gravity);
        if !self.mirror {
            return straight;
        }
        let image = mirrored(window.positions, domain[0]);
        let obstacles: Vec<_> = window.obstacles.iter().map(|o| o.mirrored(domain[0])).collect();
        let image = Window { positions: &image, obstacles: &obstacles, ..*window };
        let mirrored = self.predict(network, &image, domain, [-gravity[0], gravity[1]]);
        let pairs = straight.as_chunks::<2>().0.iter().zip(mirrored.as_chunks::<2>().0);
        pairs.flat_map(|(a, b)| [(a[0] - b[0]) / 2.0, (a[1] + b[1]) / 2.0]).collect()
    }

    /// The prediction of the network for one window.
    fn predict(
        &self,
        network: &mut Inference,
        window: &Window,
        domain: [f64; 2],
        gravity: [f64; 2],
    ) -> Vec<f64> {
        let bounds = domain.map(|length| [0.0, length]);
        let input = window_input::<Cpu>(
            &[*window],
            &self.config,
            &self.normalisation,
            &bounds,
            &self.device,
        );
        let output = network.forward(&input);
        let Normalisation { acceleration_mean, acceleration_std, .. } = &self.normalisation;
        let scale = |(place, a): (usize, f32)| {
            let axis = place % 2;
            let fall = if self.training.without_gravity { gravity[axis] } else { 0.0 };
            f64::from(a) * acceleration_std[axis] + acceleration_mean[axis] + fall
        };
        output.into_iter().enumerate().map(scale).collect()
    }
}
