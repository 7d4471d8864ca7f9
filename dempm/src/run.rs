//! `dempm run`: a scene into a trajectory file, with progress, checkpoints and a summary.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use files::{INTERRUPTED, interrupt_flag, refuse_input};
use gpu::ranks::{Environment, Ranks};
use indicatif::{MultiProgress, ProgressDrawTarget};
use miette::{Context, IntoDiagnostic, bail};

use crate::device::Device;
use crate::scene::{Material, Scene};
use crate::sitting::{Options, Outcome, sit};

/// Arguments of `dempm run`.
#[derive(clap::Args)]
pub struct RunArgs {
    /// Scene file (TOML).
    scene: PathBuf,
    /// Trajectory file (HDF5) [default: the scene's name with .h5, in the current directory].
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Where to compute: auto, cpu, cuda or cuda:N.
    #[arg(long, default_value = "auto")]
    device: Device,
    /// Continue an interrupted run; the result is the same, bit by bit.
    #[arg(long)]
    resume: bool,
    /// Start again even if the trajectory file exists.
    #[arg(long, conflicts_with = "resume")]
    overwrite: bool,
    /// Seconds between checkpoints, at least, and never more than 2 % of the time; 0: every frame.
    #[arg(long, value_name = "SECONDS", default_value_t = 20.0)]
    checkpoint_interval: f64,
}

/// Runs a scene; as one of several ranks if a launcher started more than one.
///
/// # Errors
/// An invalid scene, an existing output file, a failed step or a file that cannot be written.
pub fn run(args: &RunArgs) -> miette::Result<ExitCode> {
    let environment = Environment::read().into_diagnostic()?;
    let speaks = environment.rank == 0;
    let scene = Scene::load(&args.scene)?;
    if let Some(report) = scene.warning_report().filter(|_| speaks) {
        eprintln!("{report:?}");
    }
    let output = match &args.output {
        Some(path) => path.clone(),
        None => default_output(&args.scene, ".h5"),
    };
    refuse_input(&output, [&args.scene])?;
    let Place { device, ranks } = place(&scene, args.device, &environment)?;
    let bars = MultiProgress::new();
    if !speaks {
        bars.set_draw_target(ProgressDrawTarget::hidden());
    }
    let options = Options {
        device,
        ranks,
        resume: args.resume,
        overwrite: args.overwrite,
        checkpoint_interval: checkpoint_interval(args.checkpoint_interval)?,
        bars,
        total: None,
    };
    let interrupted = interrupt_flag()?;
    match sit(scene, output, &options, &interrupted)? {
        Outcome::Finished(summary) => {
            if speaks {
                print!("{summary}");
            }
            Ok(ExitCode::SUCCESS)
        }
        Outcome::Interrupted { step, steps } => {
            if speaks {
                eprintln!("interrupted at step {step} of {steps}; --resume continues");
            }
            Ok(ExitCode::from(INTERRUPTED))
        }
    }
}

/// The name of an input with another ending, in the current directory. The name may have dots of its own:
/// `cell-0.125.toml`.
pub(crate) fn default_output(input: &Path, ending: &str) -> PathBuf {
    let mut name = input.file_stem().unwrap_or_default().to_owned();
    name.push(ending);
    PathBuf::from(name)
}

/// The GPU and the peers of this process.
struct Place {
    device: Option<Arc<gpu::Device>>,
    ranks: Option<Arc<Ranks>>,
}

fn place(scene: &Scene, device: Device, environment: &Environment) -> miette::Result<Place> {
    if !environment.is_shared() {
        return Ok(Place { device: device.open().into_diagnostic()?, ranks: None });
    }
    let Environment { rank, size, local_rank, .. } = *environment;
    let has_packings = matches!(scene.material, Material::Rve(_));
    if !has_packings || device == Device::Cpu {
        bail!(
            help = "start it once, without mpirun, srun or torchrun",
            "rank {rank} of {size}: several ranks share the packings of a scene on GPUs, one each"
        );
    }
    let device = device.open_for_rank(local_rank).into_diagnostic()?;
    let scene = blake3::hash(scene.text.as_bytes());
    let ranks = Ranks::join(environment, &device, scene.as_bytes())?;
    Ok(Place { device: Some(device), ranks: Some(Arc::new(ranks)) })
}

/// The value of `--checkpoint-interval`.
///
/// # Errors
/// If it is no time.
pub fn checkpoint_interval(seconds: f64) -> miette::Result<Duration> {
    Duration::try_from_secs_f64(seconds).into_diagnostic().wrap_err("--checkpoint-interval")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_whose_names_differ_after_a_dot_have_files_of_their_own() {
        let default = |scene| default_output(Path::new(scene), ".h5");
        assert_eq!(default("a/column.toml"), Path::new("column.h5"));
        assert_eq!(default("cell-0.125.toml"), Path::new("cell-0.125.h5"));
    }
}
