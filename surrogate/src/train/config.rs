//! Training files (TOML). `docs/training.md` describes every key.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use burn::tensor::backend::Backend;
use miette::{NamedSource, SourceSpan};
use serde::{Deserialize, Serialize};

use super::schedule::Schedule;
use crate::network::burn_backend::{Cpu, device};
use crate::network::weights::{self, WeightsError};
use crate::network::{self, Initialisation, Model, ModelConfig, PAPER_NETWORKS, Precision};

/// What to train and how. The defaults are those of the paper.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrainConfig {
    /// Seed of the random weights, the order of windows, noise and mirror images.
    pub seed: u64,
    /// Name of a network of the paper, or `gns`; excludes `model`.
    pub network: Option<String>,
    /// Architecture of the network.
    pub model: Option<ModelConfig>,
    /// Training steps.
    pub steps: u64,
    /// Windows per step and process.
    pub batch: usize,
    /// Initial weights.
    pub start: Initialisation,
    /// Decay of a moving average of the weights, which is then validated and saved; 0 for none.
    pub ema: f64,
    /// Floor of the normalised accelerations that the loss is relative to: its square is added to
    /// each squared target.
    pub loss_floor: f64,
    /// What the loss of several processes is relative to.
    pub loss_over: LossOver,
    /// Precision of the network's arithmetic.
    pub precision: Precision,
    /// Examples.
    pub data: Data,
    /// Learning rate.
    pub schedule: Schedule,
    /// Unrolled windows.
    pub pushforward: Pushforward,
    /// Validation rollouts.
    pub validation: Validation,
    /// Steps between lines of the log.
    pub log_every: u64,
}

/// How trajectories become examples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Data {
    /// Take every n-th frame.
    pub stride: usize,
    /// Standard deviation of the noise on the last velocity, m/frame.
    pub noise: f64,
    /// Add mirror images.
    pub mirror: bool,
    /// Give the windows of a step similar numbers of points, so that processes do not wait for the
    /// one with the largest window.
    pub alike: bool,
    /// Learn accelerations relative to free fall.
    pub subtract_gravity: bool,
    /// Largest number of frames of a window before the first frame of a run; rollouts then start
    /// from as many fewer.
    pub before_start: usize,
    /// Memory for positions, MB; files that do not fit are read for every example.
    pub memory: usize,
}

/// Normalisation of the loss where several processes make a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LossOver {
    /// Errors of all windows relative to the targets of all windows, as in one process.
    #[default]
    Step,
    /// Mean of the losses of all processes, each relative to its own targets.
    Process,
}

/// Pushforward: windows that the network itself has unrolled, so that it learns to correct its own
/// errors.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Pushforward {
    /// Each step draws the number of unrolled frames from 0 to this; 0 for no pushforward.
    pub steps: usize,
    /// First training step with pushforward.
    pub start: u64,
}

/// When and how rollouts validate the model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Validation {
    /// Steps between validations.
    pub every: u64,
    /// Largest number of frames of a rollout; 0 for all.
    pub frames: usize,
}

impl Default for TrainConfig {
    fn default() -> Self {
        Self {
            seed: 1,
            network: None,
            model: None,
            steps: 1_000_000,
            batch: 2,
            start: Initialisation::default(),
            ema: 0.0,
            loss_floor: 0.0,
            loss_over: LossOver::default(),
            precision: Precision::F32,
            data: Data::default(),
            schedule: Schedule::default(),
            pushforward: Pushforward::default(),
            validation: Validation::default(),
            log_every: 100,
        }
    }
}

impl Default for Data {
    fn default() -> Self {
        Self {
            stride: 1,
            noise: 3e-4,
            mirror: false,
            alike: false,
            subtract_gravity: false,
            before_start: 0,
            memory: 1024,
        }
    }
}

impl Default for Validation {
    fn default() -> Self {
        Self { every: 5000, frames: 0 }
    }
}

/// A training file that cannot be used.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("{}: cannot read it", path.display())]
    Read {
        /// The training file.
        path: PathBuf,
        /// The error of the file system.
        source: std::io::Error,
    },
    /// Not TOML, an unknown key or a value of another type.
    #[error("{file}: {message}")]
    Syntax {
        /// The training file.
        file: String,
        /// The error of the parser.
        message: String,
        /// Text of the file.
        #[source_code]
        text: Arc<NamedSource<String>>,
        /// Where in the text.
        #[label("here")]
        place: Option<SourceSpan>,
    },
    /// A value out of range.
    #[error("{file}: `{key}` is {value}, but must be {range}")]
    Range {
        /// The training file.
        file: String,
        /// The key.
        key: &'static str,
        /// Its value.
        value: String,
        /// Valid values.
        range: String,
    },
    /// A network by name and by architecture.
    #[error("{file}: `network` and [model] exclude each other")]
    #[diagnostic(help("remove one of them"))]
    Both {
        /// The training file.
        file: String,
    },
    /// An invalid architecture.
    #[error("{file}")]
    Model {
        /// The training file.
        file: String,
        /// The key and its valid values.
        source: network::ConfigError,
    },
    /// The weights to start from cannot be used.
    #[error("{file}: `start`")]
    Start {
        /// The training file.
        file: String,
        /// The error of the weights file.
        source: Box<WeightsError>,
    },
    /// The weights to start from belong to another network.
    #[error("{file}: the network is not that of `start` = {}: {differences}", weights.display())]
    #[diagnostic(help("without `network` and [model], the network of `start` is trained"))]
    OtherNetwork {
        /// The training file.
        file: String,
        /// The weights file.
        weights: PathBuf,
        /// The keys that differ.
        differences: String,
    },
}

impl TrainConfig {
    /// Reads and validates a training file. The path of weights to start from is relative to its
    /// folder; without `network` and `model`, the network is theirs.
    ///
    /// # Errors
    /// If the file cannot be read or a value is wrong (the error names the key), or if the weights
    /// belong to another network.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| ConfigError::Read { path: path.to_owned(), source })?;
        let file = path.display().to_string();
        let mut config = Self::read(&text, &file)?;
        if let Initialisation::Weights(weights) = &config.start {
            let weights = path.parent().unwrap_or(Path::new("")).join(weights);
            config.take_network(&weights, &file)?;
            config.start = Initialisation::Weights(weights);
        }
        config.check(&file)?;
        Ok(config)
    }

    /// Parses and validates the text of a training file, except for weights to start from. `file`
    /// is its name in errors.
    ///
    /// # Errors
    /// If a value is wrong; the error names the key.
    pub fn parse(text: &str, file: &str) -> Result<Self, ConfigError> {
        let config = Self::read(text, file)?;
        config.check(file)?;
        Ok(config)
    }

    fn read(text: &str, file: &str) -> Result<Self, ConfigError> {
        toml::from_str(text).map_err(|error| ConfigError::Syntax {
            file: file.to_owned(),
            message: error.message().to_owned(),
            text: Arc::new(NamedSource::new(file, text.to_owned()).with_language("TOML")),
            place: error.span().map(Into::into),
        })
    }

    /// Adopts the network of a weights file, unless the training file specifies one.
    fn take_network(&mut self, weights: &Path, file: &str) -> Result<(), ConfigError> {
        let (_, found, ..) = weights::load::<Cpu>(weights, &device()).map_err(|source| {
            ConfigError::Start { file: file.to_owned(), source: source.into() }
        })?;
        if self.network.is_none() && self.model.is_none() {
            self.model = Some(found);
            return Ok(());
        }
        let differences = self.network(file)?.differences(&found);
        if differences.is_empty() {
            return Ok(());
        }
        let (file, weights) = (file.to_owned(), weights.to_owned());
        Err(ConfigError::OtherNetwork { file, weights, differences: differences.join(", ") })
    }

    /// The network to train.
    ///
    /// # Errors
    /// If its name is unknown, or a name and an architecture are given.
    fn network(&self, file: &str) -> Result<ModelConfig, ConfigError> {
        match (&self.network, &self.model) {
            (Some(_), Some(_)) => Err(ConfigError::Both { file: file.to_owned() }),
            (None, model) => Ok(model.clone().unwrap_or_default()),
            (Some(name), None) => ModelConfig::named(name).ok_or_else(|| ConfigError::Range {
                file: file.to_owned(),
                key: "network",
                value: format!("{name:?}"),
                range: format!("one of {}, gns", PAPER_NETWORKS.join(", ")),
            }),
        }
    }

    /// The network with its initial weights, the same on every device. Weights of a file replace
    /// them later, as those of a checkpoint do.
    pub fn initial_network<B: Backend>(&self, model: &ModelConfig, device: &B::Device) -> Model<B> {
        let random = Model::new(model, self.seed, device);
        match self.start {
            Initialisation::Random | Initialisation::Weights(_) => random,
            Initialisation::Identity => random.near_identity(),
        }
    }

    /// The network of a validated training file.
    pub fn model(&self) -> ModelConfig {
        self.network("").expect("the configuration is valid")
    }

    fn check(&self, file: &str) -> Result<(), ConfigError> {
        let model = self.network(file)?;
        model.validate().map_err(|source| ConfigError::Model { file: file.to_owned(), source })?;
        let Schedule { rate, final_rate, decay_steps, .. } = self.schedule;
        let limits = [
            ("steps", self.steps as f64, 1.0, 1e12),
            ("batch", self.batch as f64, 1.0, 4096.0),
            ("ema", self.ema, 0.0, 0.999_999_9),
            ("loss_floor", self.loss_floor, 0.0, 1e3),
            ("log_every", self.log_every as f64, 1.0, 1e9),
            ("data.stride", self.data.stride as f64, 1.0, 1e4),
            ("data.before_start", self.data.before_start as f64, 0.0, (model.window() - 1) as f64),
            ("data.noise", self.data.noise, 0.0, 1e3),
            ("data.memory", self.data.memory as f64, 0.0, 1e7),
            ("schedule.rate", rate, 1e-12, 1.0),
            ("schedule.final_rate", final_rate, 0.0, rate),
            ("schedule.decay_steps", decay_steps, 1.0, 1e12),
            ("pushforward.steps", self.pushforward.steps as f64, 0.0, 16.0),
            ("validation.every", self.validation.every as f64, 1.0, 1e12),
        ];
        for (key, value, low, high) in limits {
            if !(low..=high).contains(&value) {
                let (file, value) = (file.to_owned(), value.to_string());
                let range = format!("from {low} to {high}");
                return Err(ConfigError::Range { file, key, value, range });
            }
        }
        let given = model.window() - self.data.before_start;
        if (1..=given).contains(&self.validation.frames) {
            return Err(ConfigError::Range {
                file: file.to_owned(),
                key: "validation.frames",
                value: self.validation.frames.to_string(),
                range: format!(
                    "0 (all) or at least {}, since rollouts start from {given} frames",
                    given + 1
                ),
            });
        }
        Ok(())
    }

    /// What a checkpoint compares, as JSON: everything that changes the steps or the meaning of the
    /// best score. Memory and the intervals of log and validation may change, the number of steps
    /// too unless the learning rate depends on it. The path of the weights to start from may
    /// change; the checkpoint has a hash of their contents.
    pub(super) fn identity(&self) -> String {
        let default = Self::default();
        let mut same = self.clone();
        same.log_every = default.log_every;
        same.data.memory = default.data.memory;
        same.validation.every = default.validation.every;
        if let Initialisation::Weights(path) = &mut same.start {
            *path = "a model".into();
        }
        if !same.schedule.depends_on_steps() {
            same.steps = 0;
        }
        serde_json::to_string(&same).expect("a configuration is plain data")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> String {
        let error = TrainConfig::parse(text, "training.toml").unwrap_err();
        format!("{:?}", miette::Report::new(error))
    }

    #[test]
    fn an_empty_file_is_the_paper() {
        let config = TrainConfig::parse("", "training.toml").unwrap();
        assert_eq!(config, TrainConfig::default());
        assert_eq!(config.model(), ModelConfig::named("baseline").unwrap());
    }

    #[test]
    fn errors_name_file_and_key() {
        for (text, key) in [
            ("step = 5", "step"),
            ("steps = \"many\"", "steps"),
            ("batch = 0", "batch"),
            ("network = \"huge\"", "network"),
            ("network = \"msg0\"\n[model]\nwidth = 8", "network"),
            ("[model]\nwidth = 0", "width"),
            ("[model]\ndimensions = 3", "`dimensions`"),
            ("[data]\nnoise = -1.0", "data.noise"),
            ("[schedule]\nfinal_rate = 1.0", "schedule.final_rate"),
            ("[schedule]\nkind = \"linear\"", "linear"),
            ("[pushforward]\nsteps = 100", "pushforward.steps"),
            ("precision = \"f16\"", "f16"),
            ("start = \"identify\"", "safetensors"),
            ("[validation]\neach = 3", "each"),
            ("[model]\nframes = 65", "frames"),
        ] {
            let message = message(text);
            assert!(message.contains("training.toml"), "{message}");
            assert!(message.contains(key), "{message}");
        }
    }

    #[test]
    fn a_validation_predicts_a_frame_at_least() {
        let config = |frames: usize, more: &str| {
            format!("[validation]\nframes = {frames}\n[data]\n{more}\n[model]\nframes = 4")
        };
        for (frames, more) in [(0, ""), (5, ""), (2, "before_start = 3")] {
            TrainConfig::parse(&config(frames, more), "training.toml").unwrap();
        }
        for (frames, more, least) in [(1, "", 5), (4, "", 5), (1, "before_start = 3", 2)] {
            let error = TrainConfig::parse(&config(frames, more), "training.toml").unwrap_err();
            let message = error.to_string();
            assert!(message.contains(&format!("`validation.frames` is {frames}")), "{message}");
            assert!(message.contains(&format!("at least {least}")), "{message}");
        }
    }

    #[test]
    fn a_checkpoint_compares_what_changes_the_training() {
        let identity = |text: &str| TrainConfig::parse(text, "").unwrap().identity();
        for free in ["log_every = 7", "steps = 9", "[data]\nmemory = 1", "[validation]\nevery = 3"]
        {
            assert_eq!(identity(free), identity(""), "{free}");
        }
        for fixed in ["seed = 9", "[data]\nnoise = 1.0", "[validation]\nframes = 30"] {
            assert_ne!(identity(fixed), identity(""), "{fixed}");
        }
    }
}
