//! A training under way: set up from data, configuration and checkpoint.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use dempm::device::Device;
use files::FileLock;
use gpu::ranks::Environment;

use super::all_reduce::AllReduce;
use super::backend::{Backend, BackendBatch, open_device};
use super::checkpoint::{Checkpoint, Identity};
use super::config::TrainConfig;
use super::error::TrainError;
use super::folder::{checkpoint_in, clear, lock, refuse_inputs};
use super::input::InputSpec;
use super::log::Log;
use super::pretrained::{Lineage, Pretrained};
use super::ranks;
use super::state::State;
use crate::cuda::{CudaError, compile_ahead};
use crate::data::{DataError, DataFolder, DataSet, Examples, Prefetch, Recipe, Shard, WindowShape};
use crate::diagnostics::TrainingRange;
use crate::network::parameters::weights;
use crate::network::{Initialisation, ModelConfig, Precision};
use crate::rollout::InitialFrames;
use crate::simulator::{Simulator, Training};

/// Where a training reads, writes and computes.
#[derive(Clone, Debug)]
pub struct SessionOptions {
    /// The training file, named in errors.
    pub config_file: PathBuf,
    /// Folder of trajectory files, or with `train/` and `valid/`.
    pub data: PathBuf,
    /// Folder for models, log and checkpoint.
    pub folder: PathBuf,
    /// Continue from the checkpoint in the folder.
    pub resume: bool,
    /// Where to compute.
    pub device: Device,
}

/// A training in numbers.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Name of the GPU; none on the CPU.
    pub gpu: Option<String>,
    /// Processes that train together.
    pub ranks: usize,
    /// Trainable parameters.
    pub parameters: usize,
    /// Windows to learn from.
    pub windows: usize,
    /// Files to learn from.
    pub train_files: usize,
    /// Files to validate with.
    pub valid_files: usize,
    /// Time between frames of the data, s.
    pub frame_interval: f64,
    /// Time between frames of the pretrained model, s, if it was stretched to that of the data.
    pub stretched_from: Option<f64>,
    /// Steps made before, of a resumed training.
    pub step: u64,
}

/// What the next step learns from.
pub(super) enum NextBatch {
    /// A batch for the backend.
    Ready(Box<BackendBatch>),
    /// Examples that the network in its present state unrolls first, on the CPU.
    ToUnroll(Examples),
}

/// A training under way.
pub struct Session {
    pub(super) config: TrainConfig,
    pub(super) folder: PathBuf,
    pub(super) valid: Vec<PathBuf>,
    pub(super) identity: Identity,
    pub(super) backend: Backend,
    pub(super) ranks: Box<dyn AllReduce>,
    pub(super) recipe: Recipe,
    pub(super) inputs: InputSpec,
    pub(super) batches: Prefetch<NextBatch>,
    pub(super) log: Log,
    /// Best validation MSE so far, box².
    pub(super) best: Option<f64>,
    /// Time between frames, s.
    frame_interval: f64,
    /// Kind of material of the training data; none if there are several.
    material: Option<String>,
    /// Range of the training data, those of the pretrained model included.
    range: Option<TrainingRange>,
    /// Steps of the pretrained model.
    steps_before: u64,
    summary: Summary,
}

/// The files of a training, opened.
struct OpenedData {
    files: DataFolder,
    set: DataSet,
    range: Option<TrainingRange>,
}

impl OpenedData {
    fn open(config: &TrainConfig, model: &ModelConfig, folder: &Path) -> Result<Self, TrainError> {
        let files = DataFolder::open(folder)?;
        let frames = model.window() + config.pushforward.steps;
        let (stride, before) = (config.data.stride, config.data.before_start);
        let shape = WindowShape { frames, stride, before };
        let set = DataSet::open(&files.train, shape, config.data.memory << 20)?
            .with_statics(&model.node_features)?
            .with_obstacles(model.sees_boxes())?;
        let range = TrainingRange::of(&set, model.connection_radius)?;
        Ok(Self { files, set, range })
    }

    /// Points of the largest trajectory.
    fn most_points(&self) -> usize {
        self.set.recordings().iter().map(|file| file.points()).max().unwrap_or(0)
    }
}

/// Where a training begins: its first step, or the step of its checkpoint.
struct Beginning {
    /// Weights and optimiser; none for random weights.
    state: Option<State>,
    log: Log,
    best: Option<f64>,
}

impl Beginning {
    fn find(
        options: &SessionOptions,
        config: &TrainConfig,
        identity: &Identity,
        pretrained: Option<&Pretrained>,
    ) -> Result<Self, TrainError> {
        if options.resume {
            let checkpoint = Checkpoint::read(&checkpoint_in(&options.folder), identity)?;
            let Checkpoint { state, log, best, .. } = checkpoint;
            return Ok(Self { state: Some(state), log, best });
        }
        let state = pretrained
            .map(|pretrained| State::new(weights(&pretrained.simulator.model), config.ema > 0.0));
        Ok(Self { state, log: Log::default(), best: None })
    }

    fn step(&self) -> u64 {
        self.state.as_ref().map_or(0, |state| state.step)
    }
}

impl Session {
    /// Opens the data, joins the other processes, sets the device up and starts to
    /// prepare batches. Nothing is written. A long wait for others is reported to `waiting` as by
    /// [`rendezvous`](gpu::ranks::rendezvous).
    ///
    /// # Errors
    /// If data, checkpoint, pretrained model, device or other processes do not allow the training.
    pub fn open(
        config: TrainConfig,
        options: &SessionOptions,
        waiting: impl FnOnce(&str),
    ) -> Result<Self, TrainError> {
        let environment = Environment::read()?;
        let shard = Shard { rank: environment.rank, ranks: environment.size };
        let model = config.model();
        let data = OpenedData::open(&config, &model, &options.data)?;
        let start = match &config.start {
            Initialisation::Weights(path) => Some(path),
            Initialisation::Random | Initialisation::Identity => None,
        };
        let files = data.files.train.iter().chain(&data.files.valid);
        let inputs: Vec<&PathBuf> = files.chain([&options.config_file]).chain(start).collect();
        refuse_inputs(&options.folder, &inputs)?;
        let frame_interval = data.set.frame_interval();
        let material = data.set.material().map(str::to_owned);

        let mut pretrained = Pretrained::load(&config)?;
        let hash = pretrained.as_ref().map(|pretrained| pretrained.hash);
        let identity = Identity::of(&config, &data.set, shard.ranks, hash, &data.files.valid)?;
        let stretched_from = match &mut pretrained {
            Some(pretrained) => pretrained.adapt(&config, frame_interval)?,
            None => None,
        };
        let lineage = Lineage::new(pretrained.as_ref(), identity.normalisation.clone(), data.range);

        let device = open_device(options.device, &environment)?;
        if device.is_none() && config.precision == Precision::Bf16 {
            return Err(TrainError::Bf16OnCpu { config: options.config_file.clone() });
        }
        if let Some(device) = &device {
            compile_ahead(device, config.precision)?;
        }
        let beginning = Beginning::find(options, &config, &identity, pretrained.as_ref())?;
        let step = beginning.step();
        let fingerprint = identity.fingerprint(step, device.is_some());
        let (ranks, gpus) = ranks::join(environment, device.as_ref(), &fingerprint, waiting)?;
        let points = config.batch * data.most_points();
        let mut backend = Backend::new(device.as_ref(), gpus, &model, &config, points)?;
        if let Some(state) = beginning.state
            && !backend.resume(state)?
        {
            return Err(TrainError::OtherNetwork { path: checkpoint_in(&options.folder) });
        }

        let summary = Summary {
            gpu: device.map(|device| device.name().to_owned()),
            ranks: shard.ranks,
            parameters: model.parameter_count(),
            windows: data.set.len(),
            train_files: data.files.train.len(),
            valid_files: data.files.valid.len(),
            frame_interval,
            stretched_from,
            step,
        };
        let recipe = recipe(&config, &model, shard, &lineage);
        let inputs = InputSpec {
            config: model,
            normalisation: lineage.normalisation,
            bounds: data.set.bounds(),
        };
        let batches = prefetch(data.set, &recipe, step, &backend, &inputs)?;
        Ok(Self {
            config,
            folder: options.folder.clone(),
            valid: data.files.valid,
            identity,
            backend,
            ranks,
            recipe,
            inputs,
            batches,
            log: beginning.log,
            best: beginning.best,
            frame_interval,
            material,
            range: lineage.range,
            steps_before: lineage.steps,
            summary,
        })
    }

    /// The training in numbers.
    pub fn summary(&self) -> &Summary {
        &self.summary
    }

    /// Whether this process reports and writes for all.
    pub fn is_leader(&self) -> bool {
        self.ranks.rank() == 0
    }

    /// Takes the folder: locks it and removes the files of an old training, unless this one resumes
    /// it. Only the leading process takes it. Validation files are checked first, so that nothing is
    /// removed for a training that cannot be.
    ///
    /// # Errors
    /// If a validation file cannot start a rollout, or the folder cannot be used.
    pub fn take_folder(&self, resume: bool) -> Result<Option<FileLock>, TrainError> {
        if !self.is_leader() {
            return Ok(None);
        }
        self.check_validation()?;
        let lock = lock(&self.folder)?;
        if !resume {
            clear(&self.folder)?;
        }
        Ok(Some(lock))
    }

    /// Checks that every validation file can start a rollout with a frame to predict.
    fn check_validation(&self) -> Result<(), TrainError> {
        let simulator = self.simulator()?;
        for path in &self.valid {
            let initial = InitialFrames::from_trajectory(path, 0, &simulator)?;
            let needed = initial.positions.len();
            if initial.frames <= needed {
                return Err(TrainError::ShortValidation {
                    path: path.clone(),
                    found: initial.frames,
                    needed,
                    interval: self.frame_interval,
                });
            }
        }
        Ok(())
    }

    /// The model in its present state.
    pub(super) fn simulator(&self) -> Result<Simulator, CudaError> {
        let training = Training {
            before_start: self.config.data.before_start,
            steps: self.steps_before + self.backend.step_number(),
            material: self.material.clone(),
            range: self.range,
            ..Training::untrained(self.frame_interval, self.config.data.subtract_gravity)
        };
        let InputSpec { config, normalisation, .. } = &self.inputs;
        let (config, normalisation) = (config.clone(), normalisation.clone());
        let simulator = Simulator::new(self.backend.model()?, config, normalisation, training);
        Ok(Simulator {
            gpu: self.backend.gpu(),
            #[cfg(feature = "burn-cuda")]
            burn_gpu: self.backend.burn_gpu(),
            ..simulator
        })
    }
}

/// How windows become batches.
fn recipe(config: &TrainConfig, model: &ModelConfig, shard: Shard, lineage: &Lineage) -> Recipe {
    Recipe {
        seed: config.seed,
        batch: config.batch,
        shard,
        alike: config.data.alike,
        emphasis: config.data.emphasis,
        frames: model.window(),
        unroll: config.pushforward.steps,
        unroll_from: config.pushforward.start,
        noise: config.data.noise,
        mirror: config.data.mirror,
        without_gravity: config.data.subtract_gravity,
        normalisation: lineage.normalisation.clone(),
    }
}

/// Starts to prepare the batches from `step` on.
fn prefetch(
    data: DataSet,
    recipe: &Recipe,
    step: u64,
    backend: &Backend,
    inputs: &InputSpec,
) -> Result<Prefetch<NextBatch>, DataError> {
    let (unrolls, prepare) = (backend.unrolls(), backend.prepare(inputs));
    let batching = Arc::new(recipe.clone());
    Prefetch::start(data, recipe.clone(), step, move |examples| {
        if examples.unroll > 0 && !unrolls {
            NextBatch::ToUnroll(examples)
        } else {
            NextBatch::Ready(Box::new(prepare(&batching, &examples)))
        }
    })
}
