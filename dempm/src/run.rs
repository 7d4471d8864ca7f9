//! `dempm run`: a scene into a trajectory file, with progress, checkpoints and a summary.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressState, ProgressStyle};
use miette::{Context, IntoDiagnostic, bail};

use crate::checkpoint;
use crate::device::Device;
use crate::scene::Scene;
use crate::simulation::{Simulation, SimulationError};
use crate::summary;
use crate::trajectory::{TrajectoryWriter, utc_now};
use crate::watch::Watch;

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

/// Checkpoints take at most this part of the time.
const CHECKPOINT_SHARE: f64 = 0.02;
/// Exit code after Ctrl-C, as shells use it.
pub(crate) const INTERRUPTED: u8 = 130;

/// Runs a scene.
///
/// # Errors
/// An invalid scene, an existing output file, a failed step or a file that cannot be written.
pub fn run(args: &RunArgs) -> miette::Result<ExitCode> {
    let scene = Scene::load(&args.scene)?;
    if let Some(report) = scene.warning_report() {
        eprintln!("{report:?}");
    }
    let output = match &args.output {
        Some(path) => path.clone(),
        None => PathBuf::from(args.scene.file_stem().unwrap_or_default()).with_extension("h5"),
    };
    let options = Options {
        device: args.device.open().into_diagnostic()?,
        resume: args.resume,
        overwrite: args.overwrite,
        checkpoint_interval: checkpoint_interval(args.checkpoint_interval)?,
        bars: MultiProgress::new(),
        total: None,
    };
    let interrupted = interrupt_flag()?;
    match sit(scene, output, &options, &interrupted)? {
        Outcome::Finished(summary) => {
            print!("{summary}");
            Ok(ExitCode::SUCCESS)
        }
        Outcome::Interrupted { step, steps } => {
            eprintln!("interrupted at step {step} of {steps}; --resume continues");
            Ok(ExitCode::from(INTERRUPTED))
        }
    }
}

/// How a scene is run.
pub(crate) struct Options {
    /// The GPU that advances RVEs, `None` for the CPU.
    pub device: Option<Arc<gpu::Device>>,
    /// Continue an interrupted run.
    pub resume: bool,
    /// Start again even if the trajectory file exists.
    pub overwrite: bool,
    /// Pause between checkpoints; zero: every frame.
    pub checkpoint_interval: Duration,
    /// Where progress is shown.
    pub bars: MultiProgress,
    /// Progress of many scenes together, in steps of material points.
    pub total: Option<ProgressBar>,
}

/// How a sitting ended. Both leave a trajectory that opens; a failure is an error.
pub(crate) enum Outcome {
    /// With its summary.
    Finished(String),
    /// At this step, with a checkpoint.
    Interrupted { step: usize, steps: usize },
}

/// Runs a scene from the start or a checkpoint to the end or an interrupt.
///
/// # Errors
/// An existing output file, a failed step or a file that cannot be written.
pub(crate) fn sit(
    scene: Scene,
    output: PathBuf,
    options: &Options,
    interrupted: &AtomicBool,
) -> miette::Result<Outcome> {
    let mut sitting = Sitting::start(scene, output, options)?;
    // From here on the run can be killed at any moment and resumed.
    sitting.save()?;
    let end = sitting.advance(interrupted, options.checkpoint_interval);
    sitting.finish(end)
}

/// A flag that Ctrl-C and requests to terminate set.
pub(crate) fn interrupt_flag() -> miette::Result<Arc<AtomicBool>> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed))
        .into_diagnostic()
        .wrap_err("cannot handle Ctrl-C")?;
    Ok(interrupted)
}

/// The value of `--checkpoint-interval`.
pub(crate) fn checkpoint_interval(seconds: f64) -> miette::Result<Duration> {
    Duration::try_from_secs_f64(seconds).into_diagnostic().wrap_err("--checkpoint-interval")
}

/// How the steps of a sitting ended.
enum End {
    Finished,
    Interrupted,
    Failed(SimulationError),
}

/// One run of the program on a scene: from the start or a checkpoint to the end or an interrupt.
struct Sitting {
    simulation: Simulation,
    writer: TrajectoryWriter,
    checkpoint: PathBuf,
    output: PathBuf,
    bar: ProgressBar,
    total: Option<ProgressBar>,
    saved: Instant,
    save_cost: Duration,
    watch: Watch,
}

impl Sitting {
    fn start(scene: Scene, output: PathBuf, options: &Options) -> miette::Result<Self> {
        let checkpoint = checkpoint::path_beside(&output);
        let place = |simulation: &mut Simulation| match &options.device {
            Some(device) => simulation.move_to(device),
            None => Ok(()),
        };
        let (simulation, writer) = if options.resume {
            if output.exists() && !checkpoint.exists() {
                bail!("{}: nothing to resume, there is no checkpoint beside it", output.display());
            }
            let state = checkpoint::read(&checkpoint, &scene.text)?;
            let mut simulation = Simulation::resume(scene, state)?;
            place(&mut simulation)?;
            let frames = simulation.frames_so_far();
            (simulation, TrajectoryWriter::resume(&output, frames)?)
        } else {
            if !options.overwrite && (output.exists() || checkpoint.exists()) {
                bail!(
                    help = "--resume continues an interrupted run, --overwrite starts again",
                    "{}: a run is there already",
                    output.display()
                );
            }
            let spinner = options.bars.add(ProgressBar::new_spinner());
            spinner.set_message("preparing packings");
            spinner.enable_steady_tick(Duration::from_millis(100));
            let mut simulation = Simulation::new(scene)?;
            place(&mut simulation)?;
            spinner.finish_and_clear();
            let header = simulation.header(utc_now());
            let mut writer =
                TrajectoryWriter::create(&output, &header, &simulation.static_points())?;
            writer.push(simulation.frame())?;
            (simulation, writer)
        };
        let bar = options.bars.add(ProgressBar::new(simulation.scene.steps() as u64));
        bar.set_style(
            ProgressStyle::with_template(
                "{prefix}{bar:24} {percent:>3} %  {pos}/{len}  {rate}  {eta} left  {msg}",
            )
            .expect("the template is valid")
            .with_key(
                "rate",
                |state: &ProgressState, text: &mut dyn std::fmt::Write| {
                    // A terminal that cannot be written to is no reason to stop.
                    let _ = write!(text, "{:.0} steps/s", state.per_sec());
                },
            ),
        );
        if options.total.is_some() {
            bar.set_prefix(format!("{:<20} ", simulation.scene.title));
        }
        bar.set_position(simulation.state.step as u64);
        bar.reset_eta();
        let total = options.total.clone();
        if let Some(total) = &total {
            total.inc(simulation.state.step as u64 * simulation.state.points.len() as u64);
            total.reset_eta();
        }
        Ok(Self {
            simulation,
            writer,
            checkpoint,
            output,
            bar,
            total,
            saved: Instant::now(),
            save_cost: Duration::ZERO,
            watch: Watch::default(),
        })
    }

    fn advance(&mut self, interrupted: &AtomicBool, interval: Duration) -> End {
        let steps = self.simulation.scene.steps();
        let per_frame = self.simulation.scene.steps_per_frame();
        while self.simulation.state.step < steps {
            if interrupted.load(Ordering::Relaxed) {
                return End::Interrupted;
            }
            let before = self.simulation.state.step;
            if let Err(error) = self.simulation.advance() {
                return End::Failed(error);
            }
            let step = self.simulation.state.step;
            let frame_done = step.is_multiple_of(per_frame);
            if frame_done {
                let frame = self.simulation.frame();
                self.bar.set_message(summary::progress(&frame));
                for doubt in self.watch.observe(&self.simulation, &frame) {
                    self.bar.suspend(|| eprintln!("{doubt}"));
                }
                // Frames of one simulation agree in their fields by construction.
                self.writer.push(frame).expect("frames agree");
            }
            self.bar.set_position(step as u64);
            if let Some(total) = &self.total {
                total.inc(((step - before) * self.simulation.state.points.len()) as u64);
            }
            let due = if interval.is_zero() {
                frame_done
            } else {
                let pause = interval.max(self.save_cost.div_f64(CHECKPOINT_SHARE));
                self.saved.elapsed() >= pause
            };
            if due && let Err(report) = self.save() {
                self.bar.suspend(|| eprintln!("{report:?}"));
            }
        }
        End::Finished
    }

    /// Frames first, then the checkpoint: a checkpoint never knows more frames than the file.
    fn save(&mut self) -> miette::Result<()> {
        let start = Instant::now();
        self.simulation.record()?;
        self.note_wall_time();
        self.writer.commit()?;
        checkpoint::write(&self.checkpoint, &self.simulation.scene.text, &self.simulation.state)?;
        self.saved = Instant::now();
        self.save_cost = start.elapsed();
        Ok(())
    }

    fn note_wall_time(&mut self) {
        for (phase, seconds) in &self.simulation.state.wall_time {
            self.writer.set_wall_time(phase, *seconds);
        }
    }

    fn finish(mut self, end: End) -> miette::Result<Outcome> {
        self.bar.finish_and_clear();
        match end {
            End::Finished => {
                self.simulation.record_wall_time();
                self.note_wall_time();
                self.writer.finish("finished")?;
                // The trajectory is complete; nothing is left to resume.
                if self.checkpoint.exists() {
                    std::fs::remove_file(&self.checkpoint).into_diagnostic()?;
                }
                Ok(Outcome::Finished(summary::summary(
                    &self.simulation,
                    self.watch.stable_step(),
                    &self.output,
                )))
            }
            End::Interrupted => {
                self.save()?;
                let (step, steps) = (self.simulation.state.step, self.simulation.scene.steps());
                Ok(Outcome::Interrupted { step, steps })
            }
            End::Failed(error) => {
                let frames = self.writer.frames();
                self.writer.finish(&format!("failed: {error}"))?;
                Err(miette::Report::new(error).wrap_err(format!(
                    "{} holds the {frames} frames before",
                    self.output.display()
                )))
            }
        }
    }
}
