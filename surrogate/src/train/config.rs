//! Training files: what to train and how, as TOML. `docs/training.md` describes every key.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use burn::tensor::backend::Backend;
use miette::{NamedSource, SourceSpan};
use serde::{Deserialize, Serialize};

use super::schedule::Schedule;
use crate::backend::{Cpu, device};
use crate::config::{ModelConfig, PAPER_NETWORKS};
use crate::cuda;
use crate::model::{Model, Start};
use crate::weights::{self, WeightsError};

/// A training. The defaults are those of the paper.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrainConfig {
    /// Seed of weights, order, noise and mirror images.
    pub seed: u64,
    /// A network of the paper by name; or else `model`.
    pub network: Option<String>,
    /// A network by its sizes.
    pub model: Option<ModelConfig>,
    /// Training steps.
    pub steps: u64,
    /// Windows in a step.
    pub batch: usize,
    /// Weights to start from.
    pub start: Start,
    /// Decay of a moving average of the weights, which then is what is validated and saved; 0
    /// for none.
    pub ema: f64,
    /// Smallest root mean square of normalised accelerations that the loss of a batch is relative
    /// to: their squares are added to those of the targets.
    pub loss_floor: f64,
    /// Whose targets the loss of a step of several processes is relative to.
    pub loss_over: LossOver,
    /// Precision of the network's arithmetic.
    pub precision: Precision,
    pub data: Data,
    pub schedule: Schedule,
    pub pushforward: Pushforward,
    pub validation: Validation,
    /// Steps between lines of the log.
    pub log_every: u64,
}

/// How examples are made of the trajectories.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Data {
    /// Take every n-th frame.
    pub stride: usize,
    /// Standard deviation of the noise on the last velocity, m/frame.
    pub noise: f64,
    /// Add mirror images.
    pub mirror: bool,
    /// Give the windows of a step about the same number of points: processes that have one each then
    /// do not wait for the one with the most.
    pub alike: bool,
    /// Learn accelerations relative to free fall.
    pub subtract_gravity: bool,
    /// Frames of a window that may be from before the first of a run, at most: rollouts then start
    /// from so many fewer.
    pub before_start: usize,
    /// Memory for positions, MB; what does not fit is read from the files again and again.
    pub memory: usize,
}

/// What becomes of the loss where several processes make a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LossOver {
    /// Errors of all windows relative to the targets of all, as one process with all windows has it.
    #[default]
    Step,
    /// The mean of the losses of all processes, each relative to its own targets.
    Process,
}

/// Precision of products; weights and sums are single precision in any case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    #[default]
    F32,
    /// Tensor cores of a GPU.
    Bf16,
}

impl From<Precision> for cuda::Precision {
    fn from(precision: Precision) -> Self {
        match precision {
            Precision::F32 => Self::F32,
            Precision::Bf16 => Self::Bf16,
        }
    }
}

/// Windows that the model itself has moved on, so that it learns to go on from its own errors.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Pushforward {
    /// Each step draws how many frames from 0 to this; 0 for no pushforward.
    pub steps: usize,
    /// Training step with which it begins.
    pub start: u64,
}

/// When and how rollouts judge the model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Validation {
    /// Steps between validations.
    pub every: u64,
    /// Frames of a rollout at most; 0 for all.
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
            start: Start::default(),
            ema: 0.0,
            loss_floor: 0.0,
            loss_over: LossOver::default(),
            precision: Precision::default(),
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
    #[error("{}: cannot read it", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{file}: {message}")]
    Syntax {
        file: String,
        message: String,
        #[source_code]
        text: Arc<NamedSource<String>>,
        #[label("here")]
        place: Option<SourceSpan>,
    },
    #[error("{file}: `{key}` is {value}, but it must be {range}")]
    Range { file: String, key: &'static str, value: String, range: String },
    #[error("{file}: `network` and [model] are both given")]
    #[diagnostic(help("a network has either a name or sizes"))]
    Both { file: String },
    #[error("{file}")]
    Model { file: String, source: crate::config::ConfigError },
    #[error("{file}: `start`")]
    Start { file: String, source: Box<WeightsError> },
    #[error("{file}: the network is not that of `start` = {}: {differences}", weights.display())]
    #[diagnostic(help("without `network` and [model] it is"))]
    OtherNetwork { file: String, weights: PathBuf, differences: String },
}

impl TrainConfig {
    /// Reads and validates a training file. Weights to start from are found from its folder; unless
    /// it says otherwise, the network is theirs.
    ///
    /// # Errors
    /// If it cannot be read or is wrong, which the error says with the key, or if the weights are
    /// those of another network.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| ConfigError::Read { path: path.to_owned(), source })?;
        let file = path.display().to_string();
        let mut config = Self::read(&text, &file)?;
        if let Start::Weights(weights) = &config.start {
            let weights = path.parent().unwrap_or(Path::new("")).join(weights);
            config.take_network(&weights, &file)?;
            config.start = Start::Weights(weights);
        }
        config.check(&file)?;
        Ok(config)
    }

    /// Validates the text of a training file, but for weights to start from; `file` stands for it in
    /// messages.
    ///
    /// # Errors
    /// If it is wrong; the error names the key.
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

    /// Makes the network that of a file of weights, if there is nothing else asked for.
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
    /// If its name or sizes are wrong.
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

    /// The weights that the training of a network starts from, the same on every device. Those of a
    /// file are put in their place as those of a checkpoint are.
    pub fn start<B: Backend>(&self, model: &ModelConfig, device: &B::Device) -> Model<B> {
        let random = Model::new(model, self.seed, device);
        match self.start {
            Start::Random | Start::Weights(_) => random,
            Start::Identity => random.near_identity(),
        }
    }

    /// The network of a validated training.
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
            ("model.dimensions", model.dimensions as f64, 2.0, 2.0),
        ];
        for (key, value, low, high) in limits {
            if !(low..=high).contains(&value) {
                let range = match low == high {
                    true => format!("{low}"),
                    false => format!("from {low} to {high}"),
                };
                let (file, value) = (file.to_owned(), value.to_string());
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

    /// What a checkpoint compares, as JSON: all that changes the steps, or what the best model is the best
    /// in. How much is held in memory and when it is logged and validated may change. More steps may be
    /// asked for where the rate does not depend on their number. Where the weights of the start are does
    /// not matter; what they are, the checkpoint knows by itself.
    pub(super) fn identity(&self) -> String {
        let default = Self::default();
        let mut same = self.clone();
        same.log_every = default.log_every;
        same.data.memory = default.data.memory;
        same.validation.every = default.validation.every;
        if let Start::Weights(path) = &mut same.start {
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
            ("[model]\ndimensions = 3", "model.dimensions"),
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
