//! One run of the program on a scene, from the start or a checkpoint to the end or an interrupt,
//! with progress and checkpoints.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use files::{FileLock, utc_now};
use gpu::ranks::{Ranks, RanksError};
use indicatif::{MultiProgress, ProgressBar, ProgressState, ProgressStyle};
use miette::{IntoDiagnostic, bail};

use crate::checkpoint;
use crate::output::{News, Output};
use crate::record::STABLE_STEP;
use crate::scene::Scene;
use crate::simulation::{Simulation, SimulationError};
use crate::summary;
use crate::trajectory::{Trajectory, TrajectoryWriter};
use crate::watch::Watch;

/// Checkpoints take at most this part of the time.
const CHECKPOINT_SHARE: f64 = 0.02;

/// How a scene is run.
pub(crate) struct Options {
    /// The GPU that advances RVEs, `None` for the CPU.
    pub device: Option<Arc<gpu::Device>>,
    /// The peers that advance the rest of them.
    pub ranks: Option<Arc<Ranks>>,
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
    let ranks = options.ranks.as_deref();
    let mut sitting = together(ranks, Sitting::start(scene, output, options))?;
    // Once this is written, the run can be killed at any moment and resumed.
    let saved = sitting.save();
    together(ranks, saved)?;
    let end = sitting.advance(interrupted, options.checkpoint_interval);
    let failed = matches!(end, End::Failed(_));
    let finished = sitting.finish(end);
    if failed {
        // A failed device is known to its own rank only: nothing to agree on.
        return finished;
    }
    let outcome = together(ranks, finished)?;
    if let Some(ranks) = ranks {
        ranks.all_done();
    }
    Ok(outcome)
}

/// The own result, if all ranks have one: none goes on alone, waiting for a peer that is gone.
fn together<T>(ranks: Option<&Ranks>, own: miette::Result<T>) -> miette::Result<T> {
    let Some(ranks) = ranks else { return own };
    let any_failed = ranks.any(own.is_err());
    let own = own?;
    if any_failed? { Err(RanksError::Other.into()) } else { Ok(own) }
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
    ranks: Option<Arc<Ranks>>,
    /// Of several ranks only the first one writes.
    output: Option<Output>,
    /// Held by whoever writes.
    _lock: Option<FileLock>,
    checkpoint: PathBuf,
    path: PathBuf,
    bar: ProgressBar,
    total: Option<ProgressBar>,
    /// When the last checkpoint was begun, and what it cost.
    saved: Instant,
    save_cost: Duration,
    watch: Watch,
}

impl Sitting {
    fn start(scene: Scene, path: PathBuf, options: &Options) -> miette::Result<Self> {
        let checkpoint = checkpoint::path_beside(&path);
        let writes = options.ranks.as_ref().is_none_or(|ranks| ranks.is_first());
        let lock = writes.then(|| FileLock::take(&path)).transpose()?;
        let place = |simulation: &mut Simulation| match &options.device {
            Some(device) => simulation.move_to(device, options.ranks.as_ref()),
            None => Ok(()),
        };
        let mut watch = Watch::default();
        let (simulation, writer) = if options.resume {
            if !checkpoint.exists() {
                bail!(
                    help = "without --resume the run begins",
                    "{}: nothing to resume, there is no checkpoint {}",
                    path.display(),
                    checkpoint.display()
                );
            }
            let state = checkpoint::read(&checkpoint, &scene.text)?;
            let mut simulation = Simulation::resume(scene, state)?;
            place(&mut simulation)?;
            let frames = simulation.frames_so_far();
            if writes && let Some(bounds) = Trajectory::open(&path)?.budget().get(STABLE_STEP) {
                // The start is not watched: nothing has moved.
                watch.resume(bounds.iter().copied().take(frames).skip(1));
            }
            let writer = writes.then(|| TrajectoryWriter::resume(&path, frames)).transpose()?;
            (simulation, writer)
        } else {
            if writes && !options.overwrite && (path.exists() || checkpoint.exists()) {
                bail!(
                    help = "--resume continues an interrupted run, --overwrite starts again",
                    "{}: a run is there already",
                    path.display()
                );
            }
            let spinner = options.bars.add(ProgressBar::new_spinner());
            spinner.set_message("preparing packings");
            spinner.enable_steady_tick(Duration::from_millis(100));
            let mut simulation = Simulation::new(scene)?;
            place(&mut simulation)?;
            spinner.finish_and_clear();
            let mut writer = None;
            if writes {
                let header = simulation.header(utc_now());
                let points = simulation.static_points();
                let mut file = TrajectoryWriter::create(&path, &header, &points)?;
                file.push(simulation.frame())?;
                writer = Some(file);
            }
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
        let text = &simulation.scene.text;
        let output = writer.map(|writer| Output::new(writer, checkpoint.clone(), text.clone()));
        let total = options.total.clone();
        if let Some(total) = &total {
            total.inc(simulation.state.step as u64 * simulation.state.points.len() as u64);
            total.reset_eta();
        }
        Ok(Self {
            simulation,
            ranks: options.ranks.clone(),
            output,
            _lock: lock,
            checkpoint,
            path,
            bar,
            total,
            saved: Instant::now(),
            save_cost: Duration::ZERO,
            watch,
        })
    }

    fn advance(&mut self, interrupted: &AtomicBool, interval: Duration) -> End {
        let steps = self.simulation.scene.steps();
        let per_frame = self.simulation.scene.steps_per_frame();
        while self.simulation.state.step < steps {
            let before = self.simulation.state.step;
            let frame_done = before.is_multiple_of(per_frame);
            // Before the stop that they are for: where nothing is to be saved, a GPU goes on at once.
            let stop = self.agreed(interrupted.load(Ordering::Relaxed), frame_done);
            let due = interval.is_zero() || self.is_due(interval);
            // The first rank knows best what a checkpoint costs.
            let due = self.agreed(due && self.output.is_some(), frame_done);
            let (stop, due) = match (stop, due) {
                (Ok(stop), Ok(due)) => (stop, due),
                (Err(error), _) | (_, Err(error)) => return End::Failed(error.into()),
            };
            if let Err(error) = self.simulation.advance_and(!stop && !due) {
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
                if let Some(output) = &mut self.output {
                    output.push(frame);
                }
            }
            self.listen(false);
            self.bar.set_position(step as u64);
            if let Some(total) = &self.total {
                total.inc(((step - before) * self.simulation.state.points.len()) as u64);
            }
            if stop && step < steps {
                return End::Interrupted;
            }
            if due
                && (frame_done || !interval.is_zero())
                && let Err(report) = self.save()
            {
                self.bar.suspend(|| eprintln!("{report:?}"));
            }
        }
        End::Finished
    }

    /// Whether it is time for a checkpoint.
    fn is_due(&self, interval: Duration) -> bool {
        let pause = interval.max(self.save_cost.div_f64(CHECKPOINT_SHARE));
        let saving = self.output.as_ref().is_some_and(Output::is_saving);
        !saving && self.saved.elapsed() >= pause
    }

    /// Whether any rank says yes; of several ranks only after a frame, since asking takes time.
    fn agreed(&self, own: bool, frame_done: bool) -> Result<bool, RanksError> {
        match &self.ranks {
            None => Ok(own),
            Some(ranks) => Ok(frame_done && ranks.any(own)?),
        }
    }

    /// Has frames and a checkpoint written, one checkpoint at a time.
    fn save(&mut self) -> miette::Result<()> {
        let start = Instant::now();
        self.listen(true);
        self.simulation.record()?;
        if let Some(output) = &mut self.output {
            output.save(self.simulation.state.clone());
        }
        self.saved = Instant::now();
        self.save_cost = self.saved - start;
        Ok(())
    }

    /// Hears what the writing thread has to say; waits for the last checkpoint if `until_saved`.
    fn listen(&mut self, until_saved: bool) {
        let Some(output) = &mut self.output else { return };
        while let Some(news) = output.news(until_saved) {
            match news {
                News::Saved(Ok(took)) => self.save_cost += took,
                News::Saved(Err(report)) | News::Failed(report) => {
                    self.bar.suspend(|| eprintln!("{report:?}"));
                }
            }
        }
    }

    fn finish(mut self, end: End) -> miette::Result<Outcome> {
        self.bar.finish_and_clear();
        match end {
            End::Finished => {
                self.simulation.record_wall_time();
                if let Some(output) = self.output {
                    output
                        .finish("finished".to_owned(), self.simulation.state.wall_time.clone())?;
                    // The trajectory is complete; nothing is left to resume.
                    if self.checkpoint.exists() {
                        std::fs::remove_file(&self.checkpoint).into_diagnostic()?;
                    }
                }
                Ok(Outcome::Finished(summary::summary(
                    &self.simulation,
                    self.watch.stable_step(),
                    &self.path,
                )))
            }
            End::Interrupted => {
                self.save()?;
                while let Some(news) = self.output.as_mut().and_then(|output| output.news(true)) {
                    if let News::Saved(saved) = news {
                        saved?;
                    }
                }
                let (step, steps) = (self.simulation.state.step, self.simulation.scene.steps());
                Ok(Outcome::Interrupted { step, steps })
            }
            End::Failed(error) => {
                let Some(output) = self.output else { return Err(error.into()) };
                let frames = output.frames();
                let report = miette::Report::new(error);
                let reasons: Vec<String> = report.chain().map(ToString::to_string).collect();
                let status = format!("failed: {}", reasons.join(": "));
                output.finish(status, self.simulation.state.wall_time.clone())?;
                let held = format!("{} holds the {frames} frames before", self.path.display());
                Err(report.wrap_err(held))
            }
        }
    }
}
