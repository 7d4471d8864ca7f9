//! Errors of a training.

use std::path::PathBuf;

use files::{LockError, ReplacesInput};
use gpu::ranks::{EnvironmentError, RanksError};

use super::checkpoint::CheckpointError;
use super::log::LogError;
use crate::cuda::CudaError;
use crate::data::DataError;
use crate::rollout::InitialFramesError;
use crate::simulator::SimulatorError;

/// Why a training cannot start or go on.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum TrainError {
    /// The training data cannot be used.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Data(#[from] DataError),
    /// A file of the training would replace an input.
    #[error(transparent)]
    #[diagnostic(transparent)]
    ReplacesInput(#[from] ReplacesInput),
    /// The checkpoint cannot be used or written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// A model file cannot be used or written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Simulator(#[from] SimulatorError),
    /// A validation file cannot start a rollout.
    #[error(transparent)]
    #[diagnostic(transparent)]
    InitialFrames(#[from] InitialFramesError),
    /// The log cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Log(#[from] LogError),
    /// No GPU, or one that failed.
    #[error(transparent)]
    Gpu(#[from] gpu::Error),
    /// The network does not run on the GPU.
    #[error(transparent)]
    Cuda(#[from] CudaError),
    /// The launcher's environment variables are wrong.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    /// The processes of the training lost each other.
    #[error(transparent)]
    Ranks(#[from] RanksError),
    /// `precision = "bf16"` without a GPU.
    #[error("{}: `precision` is \"bf16\", which needs a GPU; this training runs on the CPU", config.display())]
    #[diagnostic(help("leave it out, or use \"f32\""))]
    Bf16OnCpu {
        /// The training file.
        config: PathBuf,
    },
    /// The weights to start from cannot be read.
    #[error("{}: cannot read it", path.display())]
    ReadWeights {
        /// The weights file.
        path: PathBuf,
        /// The error of the file system.
        source: std::io::Error,
    },
    /// The weights to start from predict other accelerations.
    #[error("`start` = {}: the network was trained with `data.subtract_gravity` = {trained}", path.display())]
    OtherGravity {
        /// The weights file.
        path: PathBuf,
        /// Its `data.subtract_gravity`.
        trained: bool,
    },
    /// There is a training in the folder.
    #[error("{}: there is a training already", folder.display())]
    #[diagnostic(help("{}", match resumable {
        true => "--resume continues it, --overwrite removes it and starts again",
        false => "it has no checkpoint to continue from; --overwrite removes it and starts again",
    }))]
    Exists {
        /// The folder.
        folder: PathBuf,
        /// Whether it has a checkpoint.
        resumable: bool,
    },
    /// The folder holds the weights to start from, which would be removed.
    #[error("{}: `start` is {}, which --overwrite removes", config.display(), weights.display())]
    #[diagnostic(help("train into another folder, or copy the model elsewhere"))]
    RemovesStart {
        /// The training file.
        config: PathBuf,
        /// The weights file.
        weights: PathBuf,
    },
    /// Another process trains into the folder, or it cannot be written.
    #[error("{}: cannot train into this folder", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// The error of the lock.
        source: LockError,
    },
    /// A file of an old training stays.
    #[error("{}: cannot remove it", path.display())]
    Remove {
        /// The file.
        path: PathBuf,
        /// The error of the file system.
        source: std::io::Error,
    },
    /// The checkpoint belongs to another network.
    #[error("{}: the checkpoint belongs to another network", path.display())]
    OtherNetwork {
        /// The checkpoint.
        path: PathBuf,
    },
    /// A validation file has no frame to predict.
    #[error(
        "{}: {found} frames, but a rollout starts from {needed} frames, {interval} s apart, and must \
         predict at least one more", path.display()
    )]
    #[diagnostic(help("remove it from valid/, or simulate it for longer"))]
    ShortValidation {
        /// The trajectory file.
        path: PathBuf,
        /// Its frames at the model's interval.
        found: usize,
        /// Frames that a rollout starts from.
        needed: usize,
        /// Time between frames, s.
        interval: f64,
    },
    /// The loss is NaN or infinite.
    #[error("the loss of step {step} is not finite; the last checkpoint is from before")]
    #[diagnostic(help("a lower schedule.rate or a schedule.warm_up may help"))]
    Diverged {
        /// Number of the step, from 1.
        step: u64,
    },
    /// The processes hold different weights.
    #[error("rank {rank} does not hold the same weights as the others")]
    #[diagnostic(help("a bug or a faulty GPU: do not trust this training"))]
    RanksDiffer {
        /// This process.
        rank: usize,
    },
    /// The thread that prepares the batches panicked.
    #[error("the thread that prepares the batches has died")]
    Prefetch,
}
