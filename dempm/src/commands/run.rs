//! `dempm run`: simulates a scene into a trajectory file.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use files::{INTERRUPTED, Interrupt, note, print_result, refuse_input};
use gpu::ranks::{Environment, Ranks};
use indicatif::{MultiProgress, ProgressDrawTarget};
use miette::{IntoDiagnostic, bail};

use super::device::report;
use super::outputs::default_output;
use super::progress::SceneProgress;
use super::summary::summary;
use crate::device::Device;
use crate::run::{Options, Outcome, checkpoint, checkpoint_interval, run_scene};
use crate::scene::{Material, Scene};

/// Arguments of `dempm run`.
#[derive(clap::Args)]
pub struct RunArgs {
    /// Scene file (TOML).
    scene: PathBuf,
    /// Trajectory file (HDF5) [default: the scene's name with .h5, in the current directory].
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Device to run on: auto (the first GPU, else the CPU), cpu, cuda or cuda:N.
    #[arg(long, default_value = "auto")]
    device: Device,
    /// Continue an interrupted run, or begin it; the result is bitwise that of an uninterrupted one.
    #[arg(long)]
    resume: bool,
    /// Start again even if the trajectory file exists.
    #[arg(long, conflicts_with = "resume")]
    overwrite: bool,
    /// Least time between checkpoints, which never take more than 2 % of the time; 0: every frame.
    #[arg(long, value_name = "SECONDS", default_value_t = 20.0)]
    checkpoint_interval: f64,
}

/// Runs a scene, as one of several ranks if a launcher started more than one.
///
/// # Errors
/// If the scene is invalid, the output exists, a step fails or a file cannot be written.
pub fn run(args: &RunArgs, verbose: bool) -> miette::Result<ExitCode> {
    let interrupt = Interrupt::install()?;
    let environment = Environment::read().into_diagnostic()?;
    let is_first = environment.rank == 0;
    let scene = Scene::load(&args.scene)?;
    if let Some(report) = scene.warning_report().filter(|_| is_first) {
        note!("{report:?}");
    }
    let output = args.output.clone().unwrap_or_else(|| default_output(&args.scene, ".h5"));
    for path in [&output, &checkpoint::path_beside(&output)] {
        refuse_input(path, [&args.scene])?;
    }
    let Place { device, ranks } = place(&scene, args.device, &environment, verbose)?;
    let bars = MultiProgress::new();
    if !is_first {
        bars.set_draw_target(ProgressDrawTarget::hidden());
    }
    let options = Options {
        device,
        ranks,
        resume: args.resume,
        overwrite: args.overwrite,
        checkpoint_interval: checkpoint_interval(args.checkpoint_interval)?,
    };
    let mut progress = SceneProgress::new(bars, None);
    match run_scene(scene, output.clone(), &options, &mut progress, &interrupt)? {
        Outcome::Finished { simulation, stable_step } => {
            if is_first {
                let _ = print_result(summary(&simulation, stable_step, &output));
            }
            Ok(ExitCode::SUCCESS)
        }
        Outcome::Interrupted { step, steps } => {
            if is_first {
                note!("interrupted at step {step} of {steps}; --resume continues");
            }
            Ok(ExitCode::from(INTERRUPTED))
        }
    }
}

/// The GPU and the peers of this process.
struct Place {
    device: Option<Arc<gpu::Device>>,
    ranks: Option<Arc<Ranks>>,
}

fn place(
    scene: &Scene,
    device: Device,
    environment: &Environment,
    verbose: bool,
) -> miette::Result<Place> {
    if !environment.is_shared() {
        let selection = device.select().into_diagnostic()?;
        report(&selection, verbose);
        return Ok(Place { device: selection.first(), ranks: None });
    }
    let Environment { rank, size, local_rank, .. } = *environment;
    let is_shared = matches!(scene.material, Material::Rve(_) | Material::Discs(_));
    if !is_shared || device == Device::Cpu {
        bail!(
            help = "start it once, without mpirun, srun or torchrun",
            "rank {rank} of {size}: several ranks share packings or discs, on one GPU each"
        );
    }
    let device = device.open_for_rank(local_rank).into_diagnostic()?;
    let scene = blake3::hash(scene.text.as_bytes());
    let ranks = Ranks::join(environment, &device, scene.as_bytes(), |ranks| {
        note!("waiting for {ranks}");
    })?;
    Ok(Place { device: Some(device), ranks: Some(Arc::new(ranks)) })
}
