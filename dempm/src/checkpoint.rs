//! Checkpoints: the complete state of a run, so that a resumed run is the uninterrupted one.

use std::path::{Path, PathBuf};

use files::{
    OutputFile, SealError, SealedWriter, WriteError, path_beside as beside, read_sealed,
    write_atomically,
};
use serde::{Deserialize, Serialize};

use crate::simulation::State;

const MAGIC: &str = "DEMPM checkpoint";
const VERSION: u32 = 2;

/// Why a checkpoint could not be used.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum CheckpointError {
    #[error("the run cannot continue from its checkpoint")]
    #[diagnostic(help("start again with --overwrite"))]
    Seal(#[from] SealError),
    #[error("{}: not a checkpoint of this version of dempm", path.display())]
    #[diagnostic(help("start again with --overwrite"))]
    Format { path: PathBuf },
    #[error("{}: the checkpoint belongs to another scene", path.display())]
    #[diagnostic(help(
        "the scene file has changed since the run began; undo the change, or start again with --overwrite"
    ))]
    OtherScene { path: PathBuf },
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
}

#[derive(Serialize)]
struct Written<'a> {
    magic: &'a str,
    version: u32,
    scene: [u8; 32],
    state: &'a State,
}

#[derive(Deserialize)]
struct Read {
    magic: String,
    version: u32,
    scene: [u8; 32],
    state: State,
}

/// The checkpoint that belongs to a trajectory file: `NAME.ckpt` beside `NAME`, as names may have dots
/// of their own.
pub fn path_beside(trajectory: &Path) -> PathBuf {
    beside(trajectory, ".ckpt")
}

/// Writes the state of a run of `scene` (its text), whole or not at all.
///
/// # Errors
/// When the file cannot be written; an older checkpoint is then untouched.
pub fn write(path: &Path, scene: &str, state: &State) -> Result<(), CheckpointError> {
    let scene = *blake3::hash(scene.as_bytes()).as_bytes();
    let content = Written { magic: MAGIC, version: VERSION, scene, state };
    write_atomically(path, |temporary| {
        OutputFile::create(temporary)
            .and_then(|mut file| {
                let buffer = std::io::BufWriter::with_capacity(1 << 20, &mut file);
                let written = postcard::to_io(&content, SealedWriter::new(buffer)).map(|writer| {
                    writer.seal()?.into_inner().map(drop).map_err(|e| e.into_error())
                });
                // Its own error says of a full disk only that a buffer is full.
                written.unwrap_or_else(|error| Err(file.failure_or(error)))
            })
            .map_err(|source| WriteError::at(path, "write it")(source).into())
    })
}

/// Reads the state of a run of `scene` (its text).
///
/// # Errors
/// When there is no such file, it is damaged, or it belongs to another scene.
pub fn read(path: &Path, scene: &str) -> Result<State, CheckpointError> {
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
    Ok(read.state)
}
