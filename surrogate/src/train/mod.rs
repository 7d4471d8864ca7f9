//! `surrogate train`: a network learns from trajectories, with progress, checkpoints and validation.

mod adam;
mod checkpoint;
mod config;
mod cuda;
mod engine;
mod folder;
mod given;
mod log;
mod parameters;
mod place;
mod progress;
#[cfg(test)]
mod rank_tests;
mod ranks;
mod schedule;
mod sitting;
mod tcp;

use std::path::PathBuf;
use std::process::ExitCode;

use dempm::device::Device;
use dempm::run::checkpoint_interval;
use files::{interrupt_flag, is_same};
use miette::bail;

pub use self::config::{ConfigError, Precision, TrainConfig};
pub use self::parameters::{gradients, weights, with_weights};
pub use self::schedule::{Decay, Schedule};
use self::sitting::Sitting;
use crate::model::Start;

/// Arguments of `surrogate train`.
#[derive(clap::Args)]
pub struct TrainArgs {
    /// Training file (TOML)
    config: PathBuf,
    /// Folder of trajectory files (*.h5), or with train/ and valid/
    #[arg(long)]
    data: PathBuf,
    /// Folder for models, log and checkpoint
    #[arg(short, long)]
    output: PathBuf,
    /// Continue an interrupted training; the result is the same, bit by bit
    #[arg(long)]
    resume: bool,
    /// Start again if the folder has a training; that one is removed
    #[arg(long, conflicts_with = "resume")]
    overwrite: bool,
    /// Seconds between checkpoints, at least
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0)]
    checkpoint_interval: f64,
    /// Where to compute: auto (a GPU if there is one), cpu, cuda or cuda:N
    #[arg(long, default_value = "auto")]
    device: Device,
}

/// Trains a network.
///
/// # Errors
/// A wrong configuration, unusable data, a training that diverges or a file that cannot be written.
pub fn train(args: &TrainArgs) -> miette::Result<ExitCode> {
    let config = TrainConfig::load(&args.config)?;
    let interval = checkpoint_interval(args.checkpoint_interval)?;
    if !args.resume {
        check_folder(args, &config)?;
    }
    let interrupted = interrupt_flag()?;
    let mut sitting = Sitting::start(args, config)?;
    let _lock = sitting.take_folder(args.resume)?;
    sitting.advance(&interrupted, interval)
}

/// Refuses a new training where an old one is, unless that may be removed and is not what the new one
/// starts from.
fn check_folder(args: &TrainArgs, config: &TrainConfig) -> miette::Result<()> {
    let folder = args.output.display();
    let Some(file) = folder::files_in(&args.output).next() else { return Ok(()) };
    if !args.overwrite {
        let help = if file == folder::checkpoint_in(&args.output) {
            "--resume continues it, --overwrite removes it and starts again"
        } else {
            "without a checkpoint none can be continued; --overwrite removes it and starts again"
        };
        bail!(help = help, "{folder}: a training is there already");
    }
    if let Start::Weights(start) = &config.start
        && folder::files_in(&args.output).any(|file| is_same(&file, start))
    {
        bail!(
            help = "train into another folder, or copy the model to another place",
            "{}: `start` is {}, which --overwrite removes",
            args.config.display(),
            start.display()
        );
    }
    Ok(())
}
