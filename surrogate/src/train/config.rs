//! Training files (TOML). `docs/training.md` describes every key.

use burn::tensor::backend::Backend;
use serde::{Deserialize, Serialize};

use super::config_error::ConfigError;
use super::schedule::Schedule;
use crate::network::parameters::{HiddenMatrix, hidden_matrices};
use crate::network::{Initialisation, Model, ModelConfig, PAPER_NETWORKS, Precision};

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
    /// What the loss is relative to.
    pub loss_over: LossOver,
    /// What makes steps of gradients.
    pub optimiser: Optimiser,
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
    /// Most appearances of a window in a pass: as many as its accelerations scatter over the points, in standard
    /// deviations of the data.
    pub emphasis: usize,
    /// Learn accelerations relative to free fall.
    pub subtract_gravity: bool,
    /// Largest number of frames of a window before the first frame of a run; rollouts then start
    /// from as many fewer.
    pub before_start: usize,
    /// Memory for positions, MB; files that do not fit are read for every example.
    pub memory: usize,
}

/// What the squared errors of a step are relative to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LossOver {
    /// Errors of all windows relative to the targets of all windows, as in one process.
    #[default]
    Step,
    /// Mean of the losses of all processes, each relative to its own targets.
    Process,
    /// Mean of the losses of all windows, each relative to its own targets, so that one with an impact
    /// does not outweigh those at rest.
    Window,
}

/// What makes steps of gradients.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Optimiser {
    /// Adam for all weights.
    #[default]
    Adam,
    /// Muon for the matrices of hidden linears, Adam for all other weights.
    Muon,
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
            optimiser: Optimiser::default(),
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
            emphasis: 1,
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

impl TrainConfig {
    /// The network to train.
    ///
    /// # Errors
    /// If its name is unknown, or a name and an architecture are given.
    pub(super) fn network(&self, file: &str) -> Result<ModelConfig, ConfigError> {
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

    /// The matrices of the network that Muon updates; none with Adam.
    pub(super) fn muon_matrices<B: Backend>(
        &self,
        model: &Model<B>,
        width: usize,
    ) -> Vec<HiddenMatrix> {
        match self.optimiser {
            Optimiser::Adam => Vec::new(),
            Optimiser::Muon => hidden_matrices(model, width),
        }
    }

    /// The network of a validated training file.
    pub fn model(&self) -> ModelConfig {
        self.network("").expect("the configuration is valid")
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
