//! Checkpoints: everything a training needs to continue as if it had never stopped.

use std::fs::File;
use std::path::{Path, PathBuf};

use files::{SealError, WriteError, read_sealed, seal, write_atomically};
use gpu::ranks::Fingerprint;
use serde::{Deserialize, Serialize};

use super::config::TrainConfig;
use super::log::Log;
use super::state::State;
use crate::data::{DataError, DataSet, Statistics, further_features};
use crate::features::Normalisation;
use crate::network::differences;

const MAGIC: &str = "DEMPM surrogate training";
const VERSION: u32 = 6;

/// State and identity of a training. Batches are a function of seed and step, so they need no
/// state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    magic: String,
    version: u32,
    identity: Identity,
    /// Weights and optimiser.
    pub state: State,
    /// The log so far.
    pub log: Log,
    /// Best validation MSE so far, box².
    pub best: Option<f64>,
}

/// Everything that must not change while a training is interrupted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// The relevant part of the configuration, as JSON.
    pub config: String,
    /// Number of processes.
    pub ranks: usize,
    /// Names, points and frames of the training files.
    pub files: Vec<(String, u64, u64)>,
    /// Their statistics, which differ if the contents do.
    pub normalisation: Normalisation,
    /// Hash of the weights file that the training started from.
    pub start: Option<[u8; 32]>,
    /// Names and hashes of the validation files, which `best` depends on.
    pub valid: Vec<(String, [u8; 32])>,
}

impl Identity {
    /// Identity of a training on `ranks` processes that starts from the weights file of hash `start` and
    /// validates with the files `valid`.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn of(
        config: &TrainConfig,
        data: &DataSet,
        ranks: usize,
        start: Option<[u8; 32]>,
        valid: &[PathBuf],
    ) -> Result<Self, DataError> {
        let mut statistics = Statistics::measure(data, config.data.subtract_gravity)?;
        if config.data.mirror {
            statistics = statistics.mirrored();
        }
        let normalisation = statistics.normalisation(config.data.noise);
        let [features_mean, features_std] =
            further_features(data, &config.model(), &normalisation)?;
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
            valid: valid.iter().map(|path| name_and_hash(path)).collect::<Result<_, _>>()?,
        })
    }

    /// Hash by which processes check that they are about to make the same step in the same way.
    pub fn fingerprint(&self, step: u64, on_gpus: bool) -> Fingerprint {
        let bytes =
            postcard::to_allocvec(&(self, step, on_gpus)).expect("an identity is plain data");
        *blake3::hash(&bytes).as_bytes()
    }
}

fn name_and_hash(path: &Path) -> Result<(String, [u8; 32]), DataError> {
    let mut hasher = blake3::Hasher::new();
    File::open(path)
        .and_then(|file| hasher.update_reader(file).map(drop))
        .map_err(|source| DataError::File { path: path.to_owned(), source })?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    Ok((name.into_owned(), *hasher.finalize().as_bytes()))
}

/// Why a checkpoint could not be used.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum CheckpointError {
    /// The file cannot be read or is damaged.
    #[error("cannot read the checkpoint")]
    #[diagnostic(help("start again with --overwrite"))]
    Seal(#[from] SealError),
    /// The file is no checkpoint of this version.
    #[error("{}: not a checkpoint of this version of surrogate", path.display())]
    #[diagnostic(help("start again with --overwrite"))]
    Format {
        /// The checkpoint.
        path: PathBuf,
    },
    /// Processes, weights or data changed.
    #[error("{}: {what} changed since the training began", path.display())]
    #[diagnostic(help("undo the change, or start again with --overwrite"))]
    Changed {
        /// The checkpoint.
        path: PathBuf,
        /// Subject and auxiliary verb.
        what: &'static str,
    },
    /// The configuration changed.
    #[error("{}: the configuration has changed since the training began: {differences}", path.display())]
    #[diagnostic(help("undo the change, or start again with --overwrite"))]
    Configuration {
        /// The checkpoint.
        path: PathBuf,
        /// The keys that differ.
        differences: String,
    },
    /// The file cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
}

impl Checkpoint {
    /// A checkpoint of the present state.
    pub fn new(identity: Identity, state: State, log: Log, best: Option<f64>) -> Self {
        Self { magic: MAGIC.to_owned(), version: VERSION, identity, state, log, best }
    }

    /// Writes the checkpoint, whole or not at all.
    ///
    /// # Errors
    /// If the file cannot be written; an older checkpoint is then untouched.
    pub fn write(&self, path: &Path) -> Result<(), CheckpointError> {
        write_atomically(path, |temporary| {
            let written = postcard::to_allocvec(self)
                .map_err(std::io::Error::other)
                .and_then(|bytes| std::fs::write(temporary, seal(bytes)));
            written.map_err(|source| {
                WriteError { path: path.to_owned(), action: "write it", source }.into()
            })
        })
    }

    /// Reads the checkpoint of the training with this identity.
    ///
    /// # Errors
    /// If there is none, it is damaged, or it belongs to another training.
    pub fn read(path: &Path, identity: &Identity) -> Result<Self, CheckpointError> {
        let bytes = read_sealed(path)?;
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
        if read.identity.valid != identity.valid {
            return Err(changed("the validation data have"));
        }
        if read.identity != *identity {
            return Err(changed("the training data have"));
        }
        Ok(read)
    }
}
