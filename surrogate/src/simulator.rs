//! A trained network with what it takes to use it.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use files::{WriteError, write_atomically};
use serde::{Deserialize, Serialize};

use crate::accuracy::Accuracy;
use crate::backend::{Cpu, Device, device};
use crate::config::ModelConfig;
use crate::cuda::{self, CudaError};
use crate::features::{Normalisation, Window, mirrored_obstacle, window_input};
use crate::inference::Inference;
use crate::model::Model;
use crate::range::Range;
use crate::start::ROUNDING;
use crate::train::Precision;
use crate::weights::{self, WeightsError};

/// What a model was trained for; kept with its weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Training {
    /// Time between frames, s.
    pub frame_interval: f64,
    /// Whether it predicts accelerations relative to free fall.
    pub without_gravity: bool,
    /// Frames of a window that may be from before the first of a run, at most.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub before_start: usize,
    /// Training steps made.
    pub steps: u64,
    /// What the training data held; older files do not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<Range>,
    /// How wrong it was on other runs; none if that was not measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<Accuracy>,
}

impl Training {
    /// That of a network which has not begun to learn, from windows within runs.
    pub fn untrained(frame_interval: f64, without_gravity: bool) -> Self {
        let (before_start, steps, range, accuracy) = (0, 0, None, None);
        Self { frame_interval, without_gravity, before_start, steps, range, accuracy }
    }

    /// Whether frames so far apart (s) are those that it was trained on, but for rounding.
    pub fn is_interval(&self, interval: f64) -> bool {
        (interval - self.frame_interval).abs() <= ROUNDING * self.frame_interval
    }
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// A network that predicts accelerations.
#[derive(Clone)]
pub struct Simulator {
    pub model: Model<Cpu>,
    pub config: ModelConfig,
    pub normalisation: Normalisation,
    pub training: Training,
    /// Averages with the mirrored prediction of the mirrored window.
    pub mirror: bool,
    pub device: Device,
    /// The GPU that rollouts are made on; without one it is the processor.
    pub gpu: Option<Arc<gpu::Device>>,
    /// Precision on that GPU; with `F32`, results are those of the processor but for rounding.
    pub precision: Precision,
}

/// A file of weights that cannot be used.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum SimulatorError {
    #[error(transparent)]
    Weights(#[from] WeightsError),
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
    #[error("{path}: the weights lack `extra.{KEY}` in their metadata, or it is damaged")]
    #[diagnostic(help("`surrogate train` writes it; docs/weights.md says what is in it"))]
    Training { path: String },
    #[error("{path}: a network in {dimensions} dimensions: rollouts are in two")]
    Dimensions { path: String, dimensions: usize },
}

/// The entry of a file of weights that holds [`Training`].
const KEY: &str = "training";

impl Simulator {
    /// On the processor, without mirror images.
    pub fn new(
        model: Model<Cpu>,
        config: ModelConfig,
        normalisation: Normalisation,
        training: Training,
    ) -> Self {
        let (mirror, device, gpu, precision) = (false, device(), None, Precision::F32);
        Self { model, config, normalisation, training, mirror, device, gpu, precision }
    }

    /// Loads what [`save`](Self::save) wrote.
    ///
    /// # Errors
    /// If the file cannot be read or is damaged.
    pub fn load(path: &Path) -> Result<Self, SimulatorError> {
        let (model, config, normalisation, extra) = weights::load(path, &device())?;
        if config.dimensions != 2 {
            let (path, dimensions) = (path.display().to_string(), config.dimensions);
            return Err(SimulatorError::Dimensions { path, dimensions });
        }
        let training = extra.get(KEY).and_then(|text| serde_json::from_str(text).ok());
        let training = training
            .ok_or_else(|| SimulatorError::Training { path: path.display().to_string() })?;
        Ok(Self::new(model, config, normalisation, training))
    }

    /// Writes the weights and everything else, whole or not at all.
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

    /// Chooses where rollouts are made. Networks that no GPU can compute stay on the processor,
    /// unless a GPU is asked for.
    ///
    /// # Errors
    /// If the GPU that is asked for cannot be used, or not for this network, or there is none for
    /// bf16.
    pub fn place(&mut self, choice: dempm::device::Device) -> Result<(), CudaError> {
        use dempm::device::Device;
        self.gpu = match (choice, cuda::supports(&self.config)) {
            (Device::Auto, Err(reason)) => {
                eprintln!("running on the CPU: {reason}");
                None
            }
            (Device::Cuda(_), Err(reason)) => return Err(reason),
            _ => choice.open()?,
        };
        if self.gpu.is_none() && self.precision == Precision::Bf16 {
            return Err(CudaError::Bf16OnCpu);
        }
        Ok(())
    }

    /// Frames of a run that a rollout starts from: a window, less those that may be from before.
    pub fn first_frames(&self) -> usize {
        self.config.window().saturating_sub(self.training.before_start).max(1)
    }

    /// The network for the processor, apart from the simulator as it remembers frames.
    pub fn inference(&self) -> Inference {
        let windows = if self.mirror { 2 } else { 1 };
        Inference::new(&self.model, &self.config, windows)
    }

    /// Accelerations of the points of a window in m/frame², x and y in turn. `gravity` is in
    /// m/frame², `domain` is the size of the domain.
    ///
    /// With `mirror`, a(X) becomes (a(X) + M a(M X)) / 2 with the reflection M of left and right:
    /// the mirrored window then has the mirrored accelerations, whatever the network has learnt.
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
        let width = domain[0] as f32;
        let obstacles: Vec<_> =
            window.obstacles.iter().map(|&o| mirrored_obstacle(o, width)).collect();
        let image = Window { positions: &image, obstacles: &obstacles, ..*window };
        let mirrored = self.predict(network, &image, domain, [-gravity[0], gravity[1]]);
        let pairs = straight.as_chunks::<2>().0.iter().zip(mirrored.as_chunks::<2>().0);
        pairs.flat_map(|(a, b)| [(a[0] - b[0]) / 2.0, (a[1] + b[1]) / 2.0]).collect()
    }

    /// What the network says.
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

/// Positions (m, x and y in turn) in a mirror of left and right, in a domain of this width.
pub fn mirrored(positions: &[f32], width: f64) -> Vec<f32> {
    let rows = positions.as_chunks::<2>().0.iter();
    rows.flat_map(|[x, y]| [width as f32 - x, *y]).collect()
}
