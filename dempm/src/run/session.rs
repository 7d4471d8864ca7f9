//! A session: a run of a scene from the start or a checkpoint to the end or an interrupt.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use files::{FileLock, Interrupt, WriteError, utc_now};
use gpu::ranks::{Ranks, RanksError};

use super::checkpoint;
use super::error::SessionError;
use super::monitor::{self, Monitor};
use super::observer::Observer;
use super::writer_thread::{Report, WriterThread};
use crate::scene::Scene;
use crate::simulation::{Simulation, SimulationError};
use crate::trajectory::{Trajectory, TrajectoryWriter};

/// Largest share of the time that is spent on checkpoints.
const CHECKPOINT_SHARE: f64 = 0.02;

/// How a scene is run.
#[derive(Clone, Default)]
pub struct Options {
    /// The GPU to run on; `None` for the CPU.
    pub device: Option<Arc<gpu::Device>>,
    /// The ranks that share the packings or discs; `None` for a run in one process.
    pub ranks: Option<Arc<Ranks>>,
    /// Continue from the checkpoint beside the trajectory file; begin if nothing is there yet, and leave a finished
    /// trajectory as it is.
    pub resume: bool,
    /// Replace an existing trajectory file.
    pub overwrite: bool,
    /// Least pause between checkpoints; zero for one at every frame.
    pub checkpoint_interval: Duration,
}

/// How a session ended. Either way the trajectory file is complete and readable.
pub enum Outcome {
    /// The run is finished.
    Finished {
        /// The simulation at the end.
        simulation: Box<Simulation>,
        /// Smallest stable macro step of any frame (s).
        stable_step: f64,
    },
    /// The run to resume was finished before.
    WasFinished,
    /// The run was interrupted and left a checkpoint.
    Interrupted {
        /// Completed macro steps.
        step: usize,
        /// Macro steps of the whole run.
        steps: usize,
    },
}

/// Runs a scene into the trajectory file `output`, from the start or a checkpoint, until it ends or
/// an interrupt is requested. During preparations an interrupt ends the process. A run to resume that is finished
/// already stays as it is.
///
/// # Errors
/// If the output exists, a step fails or a file cannot be written.
pub fn run_scene(
    scene: Scene,
    output: PathBuf,
    options: &Options,
    observer: &mut dyn Observer,
    interrupt: &Interrupt,
) -> Result<Outcome, SessionError> {
    let ranks = options.ranks.as_deref();
    let was_finished = options.resume && options.writes() && is_finished(&scene, &output);
    // Only the first rank looks at the files.
    if ranks.map_or(Ok(was_finished), |ranks| ranks.any(was_finished))? {
        if let Some(ranks) = ranks {
            ranks.all_done();
        }
        return Ok(Outcome::WasFinished);
    }
    let mut session = agreed_result(ranks, Session::start(scene, output, options, observer))?;
    // Until here there is nothing to save.
    let _guard = interrupt.guard();
    // Once this is written, the run can be killed at any moment and resumed.
    let saved = session.save();
    agreed_result(ranks, saved)?;
    let end = session.advance(interrupt, options.checkpoint_interval);
    let failed = matches!(end, End::Failed(_));
    let finished = session.finish(end);
    if failed {
        // Only the rank of a failed device knows of it: there is nothing to agree on.
        return finished;
    }
    let outcome = agreed_result(ranks, finished)?;
    if let Some(ranks) = ranks {
        ranks.all_done();
    }
    Ok(outcome)
}

/// Whether the trajectory at `path` is the finished run of a scene. One with a checkpoint beside it was killed before
/// its end was settled.
fn is_finished(scene: &Scene, path: &Path) -> bool {
    let finished =
        |file: Trajectory| file.header().scene == scene.text && file.status() == "finished";
    !checkpoint::path_beside(path).exists() && Trajectory::open(path).is_ok_and(finished)
}

/// This rank's result if all ranks have succeeded; otherwise an error on each, so that none waits for
/// one that is gone.
fn agreed_result<T>(
    ranks: Option<&Ranks>,
    own: Result<T, SessionError>,
) -> Result<T, SessionError> {
    let Some(ranks) = ranks else { return own };
    let any_failed = ranks.any(own.is_err());
    let own = own?;
    if any_failed? { Err(RanksError::Other.into()) } else { Ok(own) }
}

/// How the steps of a session ended.
enum End {
    Finished,
    Interrupted,
    Failed(SimulationError),
}

struct Session<'a> {
    simulation: Simulation,
    ranks: Option<Arc<Ranks>>,
    /// Only the first rank writes.
    writer: Option<WriterThread>,
    /// Held by the rank that writes.
    _lock: Option<FileLock>,
    checkpoint: PathBuf,
    path: PathBuf,
    observer: &'a mut dyn Observer,
    /// Start of the last checkpoint, and the time it took.
    saved: Instant,
    save_cost: Duration,
    monitor: Monitor,
}

impl<'a> Session<'a> {
    fn start(
        scene: Scene,
        path: PathBuf,
        options: &Options,
        observer: &'a mut dyn Observer,
    ) -> Result<Self, SessionError> {
        let checkpoint = checkpoint::path_beside(&path);
        let writes = options.writes();
        let lock = writes.then(|| FileLock::take(&path)).transpose()?;
        if let Some(lock) = &lock {
            lock.remove_leftovers_of(&checkpoint);
        }
        let resumes = options.resume && checkpoint.exists();
        let (simulation, monitor, writer) = if resumes {
            let (state, monitor) = checkpoint::read(&checkpoint, &scene.text)?;
            let mut simulation = Simulation::resume(scene, state)?;
            options.place(&mut simulation)?;
            let frames = simulation.frames_so_far();
            let writer = writes.then(|| TrajectoryWriter::resume(&path, frames)).transpose()?;
            (simulation, monitor, writer)
        } else {
            if writes {
                options.check_place(&scene, &path, &checkpoint)?;
            }
            observer.preparing();
            let mut simulation =
                Simulation::prepare(scene, options.device.as_ref(), options.ranks.as_deref())?;
            let monitor = Monitor::new(&simulation);
            options.place(&mut simulation)?;
            let writer = writes.then(|| create(&simulation, &path)).transpose()?;
            (simulation, monitor, writer)
        };
        observer.ready(&simulation);
        let text = &simulation.scene.text;
        let mut writer =
            writer.map(|writer| WriterThread::new(writer, checkpoint.clone(), text.clone()));
        if let Some(writer) = &mut writer {
            writer.set_warnings(monitor.warnings());
        }
        Ok(Self {
            simulation,
            ranks: options.ranks.clone(),
            writer,
            _lock: lock,
            checkpoint,
            path,
            observer,
            saved: Instant::now(),
            save_cost: Duration::ZERO,
            monitor,
        })
    }

    fn advance(&mut self, interrupt: &Interrupt, interval: Duration) -> End {
        let steps = self.simulation.scene.steps();
        let per_frame = self.simulation.scene.steps_per_frame();
        while self.simulation.step < steps {
            let before = self.simulation.step;
            let frame_done = before.is_multiple_of(per_frame);
            // The first rank sees all frames.
            match self.agreed(self.monitor.rest_time().is_some(), frame_done) {
                Ok(true) => {
                    self.stand_still();
                    break;
                }
                Ok(false) => {}
                Err(error) => return End::Failed(error.into()),
            }
            // Decided before the steps: where nothing is to be saved, a GPU goes on at once.
            let stop = self.agreed(interrupt.requested(), frame_done);
            let due = interval.is_zero() || self.is_due(interval);
            // The first rank writes and knows the cost of a checkpoint.
            let due = self.agreed(due && self.writer.is_some(), frame_done);
            let (stop, due) = match (stop, due) {
                (Ok(stop), Ok(due)) => (stop, due),
                (Err(error), _) | (_, Err(error)) => return End::Failed(error.into()),
            };
            if let Err(error) = self.simulation.advance_and(!stop && !due) {
                return End::Failed(error);
            }
            let step = self.simulation.step;
            let frame_done = step.is_multiple_of(per_frame);
            if let Err(error) = self.record(before, frame_done) {
                return End::Failed(error);
            }
            if stop && step < steps {
                return End::Interrupted;
            }
            if due
                && (frame_done || !interval.is_zero())
                && let Err(error) = self.save()
            {
                self.observer.write_failed(error);
            }
        }
        End::Finished
    }

    /// Fills the remaining frames with the last state. There is nothing left that an interrupt would save.
    fn stand_still(&mut self) {
        if let (Some(writer), Some(time)) = (&mut self.writer, self.monitor.rest_time()) {
            writer.set_rest_time(time);
        }
        while self.simulation.step < self.simulation.scene.steps() {
            let before = self.simulation.step;
            self.simulation.stand_still();
            let frame = self.simulation.has_frames().then(|| self.simulation.frame());
            self.observer.advanced(&self.simulation, before, frame.as_ref());
            if let (Some(writer), Some(frame)) = (&mut self.writer, frame) {
                writer.push(frame);
            }
        }
    }

    /// Hands a completed frame to the monitor and the writer, and reports progress since step `before`.
    ///
    /// # Errors
    /// If the frame shows that the run has left the validity of its material.
    fn record(&mut self, before: usize, frame_done: bool) -> Result<(), SimulationError> {
        let shown = frame_done && self.simulation.has_frames();
        let frame = shown.then(|| self.simulation.frame());
        self.observer.advanced(&self.simulation, before, frame.as_ref());
        let mut failure = None;
        if let Some(frame) = frame {
            let warnings = self.monitor.observe(&self.simulation, &frame);
            for warning in &warnings {
                self.observer.warning(warning);
            }
            if let Some(writer) = &mut self.writer {
                if !warnings.is_empty() {
                    writer.set_warnings(self.monitor.warnings());
                }
                writer.push(frame);
            }
            failure = monitor::failure(&self.simulation);
        }
        self.take_reports(false);
        failure.map_or(Ok(()), Err)
    }

    /// Whether it is time for a checkpoint.
    fn is_due(&self, interval: Duration) -> bool {
        let pause = interval.max(self.save_cost.div_f64(CHECKPOINT_SHARE));
        let saving = self.writer.as_ref().is_some_and(WriterThread::is_saving);
        !saving && self.saved.elapsed() >= pause
    }

    /// Whether `own` is true on any rank; several ranks agree only after a frame, as that takes time.
    fn agreed(&self, own: bool, frame_done: bool) -> Result<bool, RanksError> {
        match &self.ranks {
            None => Ok(own),
            Some(ranks) => Ok(frame_done && ranks.any(own)?),
        }
    }

    /// Has frames and a checkpoint written, one checkpoint at a time.
    fn save(&mut self) -> Result<(), SessionError> {
        let start = Instant::now();
        self.take_reports(true);
        self.simulation.record()?;
        if let Some(writer) = &mut self.writer {
            writer.save(self.simulation.state(), self.monitor.clone());
        }
        self.saved = Instant::now();
        self.save_cost = self.saved - start;
        Ok(())
    }

    /// Processes the reports of the writer thread; waits for the last checkpoint if `until_saved`.
    fn take_reports(&mut self, until_saved: bool) {
        let Some(writer) = &mut self.writer else { return };
        while let Some(report) = writer.report(until_saved) {
            match report {
                Report::Saved(Ok(took)) => self.save_cost += took,
                Report::Saved(Err(error)) | Report::Failed(error) => {
                    self.observer.write_failed(error.into());
                }
            }
        }
    }

    fn finish(self, end: End) -> Result<Outcome, SessionError> {
        self.observer.finished();
        match end {
            End::Finished => self.complete(),
            End::Interrupted => self.interrupt(),
            End::Failed(error) => Err(self.fail(error)),
        }
    }

    /// Writes the last frames and removes the checkpoint.
    fn complete(mut self) -> Result<Outcome, SessionError> {
        self.simulation.record_wall_time();
        if let Some(writer) = self.writer {
            writer.finish("finished".to_owned(), self.simulation.wall_time.clone())?;
            if self.checkpoint.exists() {
                std::fs::remove_file(&self.checkpoint)
                    .map_err(WriteError::at(&self.checkpoint, "remove it"))?;
            }
        }
        let stable_step = self.monitor.stable_step();
        Ok(Outcome::Finished { simulation: Box::new(self.simulation), stable_step })
    }

    /// Writes a last checkpoint and waits for it.
    fn interrupt(mut self) -> Result<Outcome, SessionError> {
        self.save()?;
        while let Some(report) = self.writer.as_mut().and_then(|writer| writer.report(true)) {
            if let Report::Saved(saved) = report {
                saved?;
            }
        }
        let (step, steps) = (self.simulation.step, self.simulation.scene.steps());
        Ok(Outcome::Interrupted { step, steps })
    }

    /// Writes the frames before a failure, with the failure as the status of the trajectory.
    fn fail(self, error: SimulationError) -> SessionError {
        let Some(writer) = self.writer else { return error.into() };
        let frames = writer.frames();
        let status = format!("failed: {}", with_causes(&error));
        match writer.finish(status, self.simulation.wall_time) {
            Ok(()) => SessionError::Failed { path: self.path, frames, source: error },
            Err(error) => error.into(),
        }
    }
}

/// An error and its causes in one line.
fn with_causes(error: &dyn Error) -> String {
    match error.source() {
        Some(cause) => format!("{error}: {}", with_causes(cause)),
        None => error.to_string(),
    }
}

/// A trajectory with the initial frame.
fn create(simulation: &Simulation, path: &Path) -> Result<TrajectoryWriter, SessionError> {
    let header = simulation.header(utc_now());
    let (points, grains) = (simulation.static_points(), simulation.static_grains());
    let grid = simulation.static_grid();
    let mut file =
        TrajectoryWriter::create_with(path, &header, &points, grains.as_ref(), grid.as_ref())?;
    file.push(simulation.frame())?;
    Ok(file)
}

impl Options {
    /// Whether this process writes the files: only the first rank does.
    fn writes(&self) -> bool {
        self.ranks.as_ref().is_none_or(|ranks| ranks.is_first())
    }

    /// Whether a run of `scene` may begin at `path`: nothing is there, or it is to be replaced, or to be
    /// resumed and was killed before its first checkpoint.
    fn check_place(
        &self,
        scene: &Scene,
        path: &Path,
        checkpoint: &Path,
    ) -> Result<(), SessionError> {
        if self.overwrite || !(path.exists() || checkpoint.exists()) {
            return Ok(());
        }
        if self.resume {
            let begun = Trajectory::open(path)?;
            let own = begun.header().scene == scene.text;
            if own && begun.status() == "running" {
                return Ok(());
            }
            return Err(SessionError::NothingToResume {
                path: path.to_owned(),
                status: if own { begun.status() } else { "made from another scene" }.to_owned(),
            });
        }
        Err(SessionError::Exists { path: path.to_owned() })
    }

    /// Moves the simulation to the GPU, if there is one.
    fn place(&self, simulation: &mut Simulation) -> Result<(), SimulationError> {
        match &self.device {
            Some(device) => simulation.move_to(device, self.ranks.as_ref()),
            None => Ok(()),
        }
    }
}
