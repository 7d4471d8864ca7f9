//! `dempm run`: simulates a scene into a trajectory file.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use files::{INTERRUPTED, Interrupt, announce, note, refuse_input, set_json};
use gpu::ranks::{Environment, Ranks};
use miette::{IntoDiagnostic, bail};
use serde::Serialize;

use super::device::report;
use super::outputs::default_output;
use super::progress::{SceneProgress, bars};
use super::summary::Summary;
use super::terminal::print_json;
use crate::device::Device;
use crate::run::{Observer, Options, Outcome, checkpoint, checkpoint_interval, run_scene};
use crate::scene::{Material, Scene};
use crate::trajectory::Trajectory;

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
    /// Continue an interrupted run, begin one that is not there, and leave a finished one; the result is bitwise that of
    /// an uninterrupted run.
    #[arg(long)]
    resume: bool,
    /// Start again even if the trajectory file exists.
    #[arg(long, conflicts_with = "resume")]
    overwrite: bool,
    /// Least time between checkpoints, which never take more than 2 % of the time; 0: every frame.
    #[arg(long, value_name = "SECONDS", default_value_t = 20.0)]
    checkpoint_interval: f64,
    /// Whether to end the run when everything has come to rest [default: the scene's `stop_at_rest`].
    #[arg(long, value_name = "BOOL")]
    stop_at_rest: Option<bool>,
    /// Print the summary as one JSON object.
    #[arg(long)]
    json: bool,
}

/// How a run ended.
#[derive(Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Status {
    Finished,
    /// There was nothing to resume.
    FinishedBefore,
    Interrupted,
}

/// How a run ended, and its summary.
#[derive(Serialize)]
struct Report<'a> {
    /// The trajectory file.
    output: &'a Path,
    status: Status,
    /// Macro steps made, and those of the whole run.
    step: usize,
    steps: usize,
    /// Warnings about the state of the run.
    warnings: Vec<&'a str>,
    /// Of a run that finished now.
    summary: Option<Summary>,
}

/// Runs a scene, as one of several ranks if a launcher started more than one.
///
/// # Errors
/// If the scene is invalid, the output exists, a step fails or a file cannot be written.
pub fn run(args: &RunArgs, verbose: bool) -> miette::Result<ExitCode> {
    set_json(args.json);
    let interrupt = Interrupt::install()?;
    let environment = Environment::read().into_diagnostic()?;
    let is_first = environment.rank == 0;
    let mut scene = Scene::load(&args.scene)?;
    scene.stop_at_rest = args.stop_at_rest.unwrap_or(scene.stop_at_rest);
    if let Some(report) = scene.warning_report().filter(|_| is_first) {
        note!("{report:?}");
    }
    let output = args.output.clone().unwrap_or_else(|| default_output(&args.scene, ".h5"));
    for path in [&output, &checkpoint::path_beside(&output)] {
        refuse_input(path, [&args.scene])?;
    }
    let Place { device, ranks } = place(&scene, args.device, &environment, verbose)?;
    let options = Options {
        device,
        ranks,
        resume: args.resume,
        overwrite: args.overwrite,
        checkpoint_interval: checkpoint_interval(args.checkpoint_interval)?,
    };
    // Other ranks would repeat what the first reports.
    let mut progress: Box<dyn Observer> = match is_first {
        true => Box::new(SceneProgress::new(bars(), None)),
        false => Box::new(()),
    };
    let steps = scene.steps();
    let outcome = run_scene(scene, output.clone(), &options, progress.as_mut(), &interrupt)?;
    let (status, step, summary) = match outcome {
        Outcome::Finished { simulation, stable_step } => {
            (Status::Finished, steps, Some(Summary::of(&simulation, stable_step)))
        }
        Outcome::WasFinished => (Status::FinishedBefore, steps, None),
        Outcome::Interrupted { step, .. } => (Status::Interrupted, step, None),
    };
    if is_first {
        if status == Status::Interrupted {
            note!("interrupted at step {step} of {steps}; --resume continues");
        }
        let trajectory = Trajectory::open(&output)?;
        let warnings = trajectory.warnings().unwrap_or_default();
        let report = Report { output: &output, status, step, steps, warnings, summary };
        if args.json { print_json(&report)? } else { print(&report) }
    }
    Ok(match status {
        Status::Interrupted => ExitCode::from(INTERRUPTED),
        _ => ExitCode::SUCCESS,
    })
}

/// Prints a report for people.
fn print(report: &Report<'_>) {
    let output = report.output.display();
    match &report.summary {
        Some(summary) => announce!("{summary}  {:<22}{output}", "written"),
        None if report.status == Status::Interrupted => {}
        None => announce!("{output}: finished already"),
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
