//! `dempm run`: simulates a scene into a trajectory file.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use files::{INTERRUPTED, Interrupt, announce, inform, note, refuse_input, set_json};
use gpu::ranks::{Environment, Ranks};
use miette::{IntoDiagnostic, bail, miette};
use serde::Serialize;

use super::choose::Chooser;
use super::device::report;
use super::learned::{Network, Predicted};
use super::outputs::default_output;
use super::progress::{SceneProgress, bars};
use super::summary::Summary;
use super::terminal::print_json;
use crate::choose::{Choice, Family, Judgement, Within};
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
    /// Take the cheapest model that stays so near to the grains computed one by one, instead of the scene's: metres (root
    /// mean square), or 5% of the run-out.
    #[arg(long, value_name = "DISTANCE")]
    within: Option<Within>,
    /// A network (safetensors) that is a candidate too, with the error that it expects of itself.
    #[arg(long, value_name = "MODEL", requires = "within")]
    learned: Option<PathBuf>,
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
    /// Of a run with --within that finished now.
    #[serde(skip_serializing_if = "Option::is_none")]
    choice: Option<Judgement>,
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
    if device.is_some() {
        limit_threads();
    }
    let (scene, choice) = match args.within {
        Some(_) if environment.is_shared() => {
            bail!(help = "`dempm choose` prints the choice", "--within takes a run in one process")
        }
        Some(within) => {
            let network = args.learned.as_deref().map(|model| Network::new(model, args.device));
            let network = network.transpose()?;
            let choice =
                chosen(&scene, within, network.as_ref(), &output, args.resume, device.is_some())?;
            let scene = choice.chosen_scene().map_err(|why| miette!("{}: {why}", scene.name))?;
            (scene, Some(Taken { choice, network }))
        }
        None => (scene, None),
    };
    let options = Options {
        device: device.clone(),
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
    let statement = scene.choice.clone();
    let (status, step, summary) = match choice.as_ref().and_then(Taken::network) {
        Some(network) => match network.predict(&scene, &output, args.resume, args.overwrite)? {
            Predicted::Now => (Status::Finished, steps, None),
            Predicted::Before => (Status::FinishedBefore, steps, None),
            Predicted::Interrupted => (Status::Interrupted, 0, None),
        },
        None => match run_scene(scene, output.clone(), &options, progress.as_mut(), &interrupt)? {
            Outcome::Finished { simulation, stable_step } => {
                (Status::Finished, steps, Some(Summary::of(&simulation, stable_step)))
            }
            Outcome::WasFinished => (Status::FinishedBefore, steps, None),
            Outcome::Interrupted { step, .. } => (Status::Interrupted, step, None),
        },
    };
    let mut judgement = None;
    if let (Some(Taken { choice, .. }), Some(statement), Status::Finished) =
        (&choice, statement, status)
    {
        judgement = Some(Judgement::of(choice, statement, &output, device.as_ref(), &interrupt)?);
    }
    if is_first {
        if status == Status::Interrupted {
            note!("interrupted at step {step} of {steps}; --resume continues");
        }
        let trajectory = Trajectory::open(&output)?;
        let warnings = trajectory.warnings().unwrap_or_default();
        if let Some(warning) = judgement.as_ref().and_then(Judgement::warning) {
            note!("warning: {warning}");
        }
        let choice = judgement;
        let report = Report { output: &output, status, step, steps, warnings, summary, choice };
        if args.json { print_json(&report)? } else { print(&report) }
    }
    Ok(match status {
        Status::Interrupted => ExitCode::from(INTERRUPTED),
        _ => ExitCode::SUCCESS,
    })
}

/// A choice, and the network that was among the candidates.
struct Taken {
    choice: Choice,
    network: Option<Network>,
}

impl Taken {
    /// The network, if it is what was chosen.
    fn network(&self) -> Option<&Network> {
        self.network.as_ref().filter(|_| self.choice.taken().family == Family::Learned)
    }
}

/// The choice of a model; a run that is continued keeps its model.
fn chosen(
    scene: &Scene,
    within: Within,
    network: Option<&Network>,
    output: &Path,
    resume: bool,
    on_gpu: bool,
) -> miette::Result<Choice> {
    let learned = network.map(|network| network.expect(scene)).transpose()?;
    let choice = Chooser::new(on_gpu)?.choice(scene, within, learned.as_ref())?;
    let choice = if resume { choice.continued(output) } else { choice };
    inform!("{}", choice.verdict());
    Ok(choice)
}

/// Prints a report for people.
fn print(report: &Report<'_>) {
    let output = report.output.display();
    match report.status {
        Status::Finished => {
            // A network has no summary.
            let summary = report.summary.as_ref().map_or_else(String::new, Summary::to_string);
            let choice = report.choice.as_ref().map_or_else(String::new, Judgement::to_string);
            announce!("{summary}{choice}  {:<22}{output}", "written");
        }
        Status::FinishedBefore => announce!("{output}: finished already"),
        Status::Interrupted => {}
    }
}

/// Most threads beside a GPU: means over grains are many short loops, which take three times as long with 32 threads as
/// with 16.
const THREADS_BESIDE_A_GPU: usize = 16;

/// Limits the threads of a run on a GPU, unless `RAYON_NUM_THREADS` says how many there are.
fn limit_threads() {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    if cores > THREADS_BESIDE_A_GPU && std::env::var_os("RAYON_NUM_THREADS").is_none() {
        let threads = rayon::ThreadPoolBuilder::new().num_threads(THREADS_BESIDE_A_GPU);
        // Fails where the threads run already, which then stay as they are.
        let _ = threads.build_global();
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
    let mut device = device.open_for_rank(local_rank).into_diagnostic()?;
    if matches!(scene.material, Material::Discs(_)) {
        // Discs on their way to other ranks go before those that still advance.
        device = device.with_urgent_stream().into_diagnostic()?;
    }
    let scene = blake3::hash(scene.text.as_bytes());
    let ranks = Ranks::join(environment, &device, scene.as_bytes(), |ranks| {
        note!("waiting for {ranks}");
    })?;
    Ok(Place { device: Some(device), ranks: Some(Arc::new(ranks)) })
}
