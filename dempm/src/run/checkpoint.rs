//! Checkpoints: the complete state of a run. A resumed run equals the uninterrupted one bit by bit.

use std::path::{Path, PathBuf};
use std::time::Duration;

use files::{OutputFile, SealError, SealedWriter, WriteError, read_sealed, write_atomically};
use serde::{Deserialize, Serialize};

use super::monitor::Monitor;
use crate::simulation::State;

const MAGIC: &str = "DEMPM checkpoint";
const VERSION: u32 = 9;

/// A checkpoint that could not be written or read.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum CheckpointError {
    /// The file cannot be read, or is damaged.
    #[error("the run cannot continue from its checkpoint")]
    #[diagnostic(help("start again with --overwrite"))]
    Seal(#[from] SealError),
    /// The file is not a checkpoint of this version.
    #[error("{}: not a checkpoint of this version of dempm", path.display())]
    #[diagnostic(help("start again with --overwrite"))]
    Format {
        /// The file.
        path: PathBuf,
    },
    /// The checkpoint was written for a different scene text.
    #[error("{}: the checkpoint belongs to another scene", path.display())]
    #[diagnostic(help(
        "the scene file has changed since the run began: undo the change, or start again with \
         --overwrite"
    ))]
    OtherScene {
        /// The checkpoint.
        path: PathBuf,
    },
    /// The file cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
}

/// An invalid pause between checkpoints.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[error("--checkpoint-interval: {0} is not a number of seconds")]
pub struct IntervalError(f64);

/// The pause between checkpoints from a number of seconds.
///
/// # Errors
/// If it is negative, not finite or too large.
pub fn interval(seconds: f64) -> Result<Duration, IntervalError> {
    Duration::try_from_secs_f64(seconds).map_err(|_| IntervalError(seconds))
}

#[derive(Serialize)]
struct Written<'a> {
    magic: &'a str,
    version: u32,
    scene: [u8; 32],
    state: &'a State,
    monitor: &'a Monitor,
}

#[derive(Deserialize)]
struct Read {
    magic: String,
    version: u32,
    scene: [u8; 32],
    state: State,
    monitor: Monitor,
}

/// The checkpoint of a trajectory file: `NAME.ckpt` beside `NAME`.
pub fn path_beside(trajectory: &Path) -> PathBuf {
    files::path_beside(trajectory, ".ckpt")
}

/// Writes the state and the monitor of a run of `scene` (the text of its file) atomically.
///
/// # Errors
/// If the file cannot be written; an older checkpoint is then untouched.
pub fn write(
    path: &Path,
    scene: &str,
    state: &State,
    monitor: &Monitor,
) -> Result<(), CheckpointError> {
    let scene = *blake3::hash(scene.as_bytes()).as_bytes();
    let content = Written { magic: MAGIC, version: VERSION, scene, state, monitor };
    write_atomically(path, |temporary| {
        OutputFile::create(temporary)
            .and_then(|mut file| {
                let buffer = std::io::BufWriter::with_capacity(1 << 20, &mut file);
                let written = postcard::to_io(&content, SealedWriter::new(buffer)).map(|writer| {
                    writer.seal()?.into_inner().map(drop).map_err(|e| e.into_error())
                });
                // On a full disk postcard reports only a full buffer.
                written.unwrap_or_else(|error| Err(file.failure_or(error)))
            })
            .map_err(|source| WriteError::at(path, "write it")(source).into())
    })
}

/// Reads the state and the monitor of a run of `scene` (the text of its file).
///
/// # Errors
/// If the file is missing, damaged, or belongs to another scene.
pub fn read(path: &Path, scene: &str) -> Result<(State, Monitor), CheckpointError> {
    let path_owned = || path.to_owned();
    let bytes = read_sealed(path)?;
    let read: Read =
        postcard::from_bytes(&bytes).map_err(|_| CheckpointError::Format { path: path_owned() })?;
    if read.magic != MAGIC || read.version != VERSION {
        return Err(CheckpointError::Format { path: path_owned() });
    }
    if read.scene != *blake3::hash(scene.as_bytes()).as_bytes() {
        return Err(CheckpointError::OtherScene { path: path_owned() });
    }
    Ok((read.state, read.monitor))
}
