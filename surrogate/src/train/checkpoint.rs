//! Checkpoints: everything that a training needs to go on as though it had never stopped.

use std::path::{Path, PathBuf};

use files::{WriteError, write_atomically};
use gpu::ranks::Fingerprint;
use serde::{Deserialize, Serialize};

use super::config::TrainConfig;
use super::engine::State;
use super::log::Log;
use crate::config::differences;
use crate::data::{DataError, DataSet, Statistics, further_features};
use crate::features::Normalisation;

const MAGIC: &str = "DEMPM surrogate training";
const VERSION: u32 = 3;

/// The state of a training and what it belongs to. Batches are a function of seed and step, so
/// they need no state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    magic: String,
    version: u32,
    identity: Identity,
    pub state: State,
    pub log: Log,
    /// The best score of a validation so far.
    pub best: Option<f64>,
}

/// What must not change while a training is interrupted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// The configuration, as far as it matters.
    pub config: String,
    /// Processes that make a step together.
    pub ranks: usize,
    /// Names, points and frames of the training files.
    pub files: Vec<(String, u64, u64)>,
    /// Their statistics: other contents have others.
    pub normalisation: Normalisation,
    /// A hash of the file of weights that it started from, if there is one.
    pub start: Option<[u8; 32]>,
}

impl Identity {
    /// What a configuration makes of data on `ranks` processes, from the `start` of that hash.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn of(
        config: &TrainConfig,
        data: &DataSet,
        ranks: usize,
        start: Option<[u8; 32]>,
    ) -> Result<Self, DataError> {
        let mut statistics = Statistics::measure(data, config.data.subtract_gravity)?;
        if config.data.mirror {
            statistics = statistics.mirrored();
        }
        let [features_mean, features_std] = further_features(data, &config.model())?;
        let normalisation = statistics.normalisation(config.data.noise);
        let files = data.recordings().iter().map(|r| {
            let name = r.path().file_name().unwrap_or_default().to_string_lossy();
            (name.into_owned(), r.points() as u64, r.frames() as u64)
        });
        Ok(Self {
            config: config.identity(),
            ranks,
            files: files.collect(),
            normalisation: Normalisation { features_mean, features_std, ..normalisation },
            start,
        })
    }

    /// A hash by which processes know that they are about to make the same step in the same way.
    pub fn fingerprint(&self, step: u64, on_gpus: bool) -> Fingerprint {
        let bytes =
            postcard::to_allocvec(&(self, step, on_gpus)).expect("an identity is plain data");
        *blake3::hash(&bytes).as_bytes()
    }
}

/// Why a checkpoint could not be used.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum CheckpointError {
    #[error("{}: cannot read the checkpoint", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{}: not a checkpoint of this version of surrogate, or damaged", path.display())]
    #[diagnostic(help("start again with --overwrite"))]
    Format { path: PathBuf },
    #[error("{}: {what} changed since the training began", path.display())]
    #[diagnostic(help("undo the change, or start again with --overwrite"))]
    Changed { path: PathBuf, what: &'static str },
    #[error("{}: the configuration has changed since the training began: {differences}", path.display())]
    #[diagnostic(help("undo the change, or start again with --overwrite"))]
    Configuration { path: PathBuf, differences: String },
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
}

impl Checkpoint {
    /// A checkpoint of this moment.
    pub fn new(identity: Identity, state: State, log: Log, best: Option<f64>) -> Self {
        Self { magic: MAGIC.to_owned(), version: VERSION, identity, state, log, best }
    }

    /// Writes it, whole or not at all.
    ///
    /// # Errors
    /// If the file cannot be written; an older checkpoint is then untouched.
    pub fn write(&self, path: &Path) -> Result<(), CheckpointError> {
        write_atomically(path, |temporary| {
            let written = postcard::to_allocvec(self)
                .map_err(std::io::Error::other)
                .and_then(|bytes| std::fs::write(temporary, bytes));
            written.map_err(|source| {
                WriteError { path: path.to_owned(), action: "write it", source }.into()
            })
        })
    }

    /// Reads the checkpoint of a training.
    ///
    /// # Errors
    /// If there is none, it is damaged, or it belongs to another training.
    pub fn read(path: &Path, identity: &Identity) -> Result<Self, CheckpointError> {
        let bytes = std::fs::read(path)
            .map_err(|source| CheckpointError::Read { path: path.to_owned(), source })?;
        let format = || CheckpointError::Format { path: path.to_owned() };
        let read: Self = postcard::from_bytes(&bytes).map_err(|_| format())?;
        if read.magic != MAGIC || read.version != VERSION {
            return Err(format());
        }
        if read.identity.config != identity.config {
            let value = |text: &str| serde_json::from_str(text).unwrap_or_default();
            let [now, then] = [&identity.config, &read.identity.config].map(|text| value(text));
            let (path, differences) = (path.to_owned(), differences(&now, &then).join(", "));
            return Err(CheckpointError::Configuration { path, differences });
        }
        let changed = |what| CheckpointError::Changed { path: path.to_owned(), what };
        if read.identity.ranks != identity.ranks {
            return Err(changed("the number of processes has"));
        }
        if read.identity.start != identity.start {
            return Err(changed("the weights of `start` have"));
        }
        if read.identity != *identity {
            return Err(changed("the training data have"));
        }
        Ok(read)
    }
}
