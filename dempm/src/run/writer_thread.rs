//! The thread that writes trajectory and checkpoints: compressing frames and flushing files takes
//! longer than a GPU needs for a frame.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::checkpoint;
use super::error::WriterError;
use super::monitor::Monitor;
use crate::simulation::State;
use crate::trajectory::{Frame, TrajectoryWriter};

/// Frames that may wait for the thread before the simulation waits.
const WAITING: usize = 8;
/// Frames written together: the lengths of all datasets change with each batch.
const TOGETHER: usize = 16;

/// The simulation's end of the thread that writes trajectory and checkpoints.
pub(super) struct WriterThread {
    jobs: SyncSender<Job>,
    reports: Receiver<Report>,
    thread: JoinHandle<Result<(), WriterError>>,
    /// Frames handed over or written before.
    frames: usize,
    saving: bool,
}

/// Jobs of the thread, done in order.
enum Job {
    Frame(Box<Frame>),
    /// Frames first, then the checkpoint: a checkpoint never knows more frames than the file.
    Save(Box<(State, Monitor)>),
    /// Warnings of the run, one a line.
    Warnings(String),
    /// The time from which on frames repeat a state at rest (s).
    RestTime(f64),
    Finish {
        status: String,
        wall_time: BTreeMap<String, f64>,
    },
}

/// Reports of the thread.
pub(super) enum Report {
    /// A checkpoint and all frames before it are on the disk; with the time that took. On failure
    /// the files are those of the checkpoint before.
    Saved(Result<Duration, WriterError>),
    /// Frames could not be written ahead of the next checkpoint.
    Failed(WriterError),
}

impl WriterThread {
    /// Starts the thread: frames go to `writer`, checkpoints of `scene` (its text) to `checkpoint`.
    pub fn new(writer: TrajectoryWriter, checkpoint: PathBuf, scene: String) -> Self {
        let (jobs, queue) = sync_channel(WAITING);
        let (sender, reports) = channel();
        let frames = writer.frames();
        let files = Files { writer, checkpoint, scene };
        let thread = std::thread::spawn(move || files.work(&queue, &sender));
        Self { jobs, reports, thread, frames, saving: false }
    }

    /// Frames handed over or written before.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Hands a frame over; waits only if too many are queued.
    pub fn push(&mut self, frame: Frame) {
        self.hand_over(Job::Frame(Box::new(frame)));
        self.frames += 1;
    }

    /// Sets the warnings of the run, one a line, in the trajectory.
    pub fn set_warnings(&mut self, warnings: &[String]) {
        self.hand_over(Job::Warnings(warnings.join("\n")));
    }

    /// Sets the time from which on frames repeat a state at rest (s), in the trajectory.
    pub fn set_rest_time(&mut self, time: f64) {
        self.hand_over(Job::RestTime(time));
    }

    /// Has all frames and a checkpoint written. [`Report::Saved`] follows.
    pub fn save(&mut self, state: State, monitor: Monitor) {
        self.hand_over(Job::Save(Box::new((state, monitor))));
        self.saving = true;
    }

    /// Whether the last checkpoint is still being written.
    pub fn is_saving(&self) -> bool {
        self.saving
    }

    /// The next report of the thread, if any. With `wait`, and while a checkpoint is being written,
    /// waits for one.
    pub fn report(&mut self, wait: bool) -> Option<Report> {
        let wait = wait && self.saving;
        let report = if wait { self.reports.recv().ok() } else { self.reports.try_recv().ok() };
        self.saving &= !matches!(report, Some(Report::Saved(_)));
        report
    }

    /// Writes the last frames and the final status of the run.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(
        self,
        status: String,
        wall_time: BTreeMap<String, f64>,
    ) -> Result<(), WriterError> {
        self.hand_over(Job::Finish { status, wall_time });
        self.thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }

    fn hand_over(&self, job: Job) {
        self.jobs.send(job).expect("the thread takes jobs until the last one");
    }
}

/// The files that the thread writes.
struct Files {
    writer: TrajectoryWriter,
    checkpoint: PathBuf,
    scene: String,
}

impl Files {
    /// Does jobs until the last one, or until the other end is dropped.
    fn work(mut self, queue: &Receiver<Job>, reports: &Sender<Report>) -> Result<(), WriterError> {
        // Frames are written ahead of the next checkpoint only while that succeeds.
        let mut ahead = false;
        let mut unwritten = 0;
        for job in queue {
            let report = match job {
                Job::Frame(frame) => {
                    // Frames of one simulation agree in their fields by construction.
                    self.writer.push(*frame).expect("frames agree");
                    unwritten += 1;
                    let due = ahead && unwritten >= TOGETHER;
                    let drafted = if due { self.writer.draft() } else { Ok(()) };
                    if due {
                        unwritten = 0;
                    }
                    drafted.err().map(|error| {
                        ahead = false;
                        Report::Failed(error.into())
                    })
                }
                Job::Warnings(warnings) => {
                    self.writer.set_warnings(warnings);
                    None
                }
                Job::RestTime(time) => {
                    self.writer.set_rest_time(time);
                    None
                }
                Job::Save(saved) => {
                    let start = Instant::now();
                    let (state, monitor) = *saved;
                    let saved = self.save(&state, &monitor);
                    ahead = saved.is_ok();
                    unwritten = 0;
                    Some(Report::Saved(saved.map(|()| start.elapsed())))
                }
                Job::Finish { status, wall_time } => {
                    self.set_wall_time(&wall_time);
                    return Ok(self.writer.finish(&status)?);
                }
            };
            if let Some(report) = report {
                // The other end may be gone.
                let _ = reports.send(report);
            }
        }
        Ok(())
    }

    fn save(&mut self, state: &State, monitor: &Monitor) -> Result<(), WriterError> {
        self.set_wall_time(&state.wall_time);
        self.writer.commit()?;
        Ok(checkpoint::write(&self.checkpoint, &self.scene, state, monitor)?)
    }

    fn set_wall_time(&mut self, wall_time: &BTreeMap<String, f64>) {
        for (phase, seconds) in wall_time {
            self.writer.set_wall_time(phase, *seconds);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scene::Scene;
    use crate::simulation::Simulation;
    use crate::trajectory::Trajectory;

    const SCENE: &str = "duration = 0.02\nframe_interval = 0.001\n[domain]\nsize = [2.0, 1.0]\n\
                         [[column]]\nsize = [0.5, 0.5]\n[material]\nkind = \"mu-i\"\n";

    /// A run with its first frame.
    fn start(directory: &Path) -> (Simulation, WriterThread) {
        let simulation = Simulation::new(Scene::parse(SCENE, "scene.toml").unwrap()).unwrap();
        let (header, points) = (simulation.header(String::new()), simulation.static_points());
        let writer = TrajectoryWriter::create(&directory.join("run.h5"), &header, &points).unwrap();
        let mut output = WriterThread::new(writer, directory.join("run.ckpt"), SCENE.to_owned());
        output.push(simulation.frame());
        (simulation, output)
    }

    /// Advances to the next frame and hands it over.
    fn next_frame(simulation: &mut Simulation, output: &mut WriterThread) {
        (0..simulation.scene.steps_per_frame()).for_each(|_| simulation.advance().unwrap());
        output.push(simulation.frame());
    }

    /// The outcome of the checkpoint that is being written.
    fn saved(output: &mut WriterThread) -> Result<Duration, WriterError> {
        while let Some(report) = output.report(true) {
            if let Report::Saved(saved) = report {
                return saved;
            }
        }
        panic!("no checkpoint was being written")
    }

    #[test]
    fn a_checkpoint_never_knows_more_frames_than_the_file() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("run.h5");
        let (mut simulation, mut output) = start(directory.path());
        for _ in 0..5 {
            next_frame(&mut simulation, &mut output);
            output.save(simulation.state(), Monitor::default());
            // The run goes on while the files are written.
            next_frame(&mut simulation, &mut output);
            saved(&mut output).unwrap();
            let (state, _) = checkpoint::read(&directory.path().join("run.ckpt"), SCENE).unwrap();
            let file = Trajectory::open(&path).unwrap();
            let shown = file.frame(file.frames() - 1).unwrap();
            assert_eq!(shown.time, state.step as f64 * simulation.scene.step);
            let there = state.points.position.iter().map(|&x| <[f64; 2]>::from(x));
            assert!(shown.position.iter().copied().eq(there));
        }
        assert_eq!(output.frames(), 11);
        output.finish("finished".to_owned(), BTreeMap::from([("mpm".into(), 2.0)])).unwrap();
        let file = Trajectory::open(&path).unwrap();
        assert_eq!((file.frames(), file.status(), file.wall_time()["mpm"]), (11, "finished", 2.0));
    }

    #[test]
    fn a_failure_is_reported_and_the_next_checkpoint_has_all_frames() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("run.h5");
        let (mut simulation, mut output) = start(directory.path());
        output.save(simulation.state(), Monitor::default());
        saved(&mut output).unwrap();

        // The file to add to is away for a while.
        let aside = directory.path().join("aside.h5");
        std::fs::rename(&path, &aside).unwrap();
        for _ in 0..TOGETHER {
            next_frame(&mut simulation, &mut output);
        }
        let Report::Failed(error) = output.reports.recv().unwrap() else { panic!("no failure") };
        assert!(error.to_string().contains("run.h5"), "{error}");
        output.save(simulation.state(), Monitor::default());
        let error = saved(&mut output).unwrap_err();
        assert!(error.to_string().contains("run.h5"), "{error}");

        std::fs::rename(&aside, &path).unwrap();
        assert_eq!(Trajectory::open(&path).unwrap().frames(), 1);
        next_frame(&mut simulation, &mut output);
        output.save(simulation.state(), Monitor::default());
        saved(&mut output).unwrap();
        assert_eq!(Trajectory::open(&path).unwrap().frames(), 2 + TOGETHER);

        std::fs::rename(&path, &aside).unwrap();
        let end = output.finish("finished".to_owned(), BTreeMap::new());
        assert!(end.unwrap_err().to_string().contains("run.h5"));
    }
}
