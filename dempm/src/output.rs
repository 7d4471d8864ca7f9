//! The files of a run, written on a thread of their own: to compress frames and to flush files takes
//! longer than a GPU takes from frame to frame.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use miette::Report;

use crate::checkpoint;
use crate::simulation::State;
use crate::trajectory::{Frame, TrajectoryWriter};

/// Frames that may wait for the thread before the run does.
const WAITING: usize = 8;

/// Trajectory and checkpoint of a run.
pub(crate) struct Output {
    jobs: SyncSender<Job>,
    news: Receiver<News>,
    thread: JoinHandle<miette::Result<()>>,
    /// Frames handed over or written before.
    frames: usize,
    saving: bool,
}

/// What the thread does, one after the other.
enum Job {
    Frame(Frame),
    /// Frames first, then the checkpoint: a checkpoint never knows more frames than the file.
    Save(Box<State>),
    Finish {
        status: String,
        wall_time: BTreeMap<String, f64>,
    },
}

/// What the thread has to say.
pub(crate) enum News {
    /// A checkpoint and all frames before it are on the disk, after so much work; or they are not,
    /// and those of the last checkpoint still are.
    Saved(miette::Result<Duration>),
    /// Frames could not be written ahead of the next checkpoint.
    Failed(Report),
}

impl Output {
    /// Writes what follows through `writer`, and checkpoints of `scene` (its text) to `checkpoint`.
    pub fn new(writer: TrajectoryWriter, checkpoint: PathBuf, scene: String) -> Self {
        let (jobs, queue) = sync_channel(WAITING);
        let (speaker, news) = channel();
        let frames = writer.frames();
        let files = Files { writer, checkpoint, scene };
        let thread = std::thread::spawn(move || files.work(&queue, &speaker));
        Self { jobs, news, thread, frames, saving: false }
    }

    /// Frames handed over so far, and those written before.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Hands a frame over; waits only if many others do.
    pub fn push(&mut self, frame: Frame) {
        self.hand_over(Job::Frame(frame));
        self.frames += 1;
    }

    /// Has all frames and a checkpoint put on the disk. [`News::Saved`] follows.
    pub fn save(&mut self, state: State) {
        self.hand_over(Job::Save(Box::new(state)));
        self.saving = true;
    }

    /// Whether the last checkpoint is still being written.
    pub fn is_saving(&self) -> bool {
        self.saving
    }

    /// The next thing that the thread has said, if anything. Waits for it only if told to, and only
    /// while a checkpoint is being written.
    pub fn news(&mut self, wait: bool) -> Option<News> {
        let news =
            if wait && self.saving { self.news.recv().ok() } else { self.news.try_recv().ok() };
        self.saving &= !matches!(news, Some(News::Saved(_)));
        news
    }

    /// Writes the last frames, and how the run ended.
    ///
    /// # Errors
    /// When the file could not be written.
    pub fn finish(self, status: String, wall_time: BTreeMap<String, f64>) -> miette::Result<()> {
        self.hand_over(Job::Finish { status, wall_time });
        self.thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }

    fn hand_over(&self, job: Job) {
        self.jobs.send(job).expect("the thread takes jobs until the last one");
    }
}

/// What the thread owns.
struct Files {
    writer: TrajectoryWriter,
    checkpoint: PathBuf,
    scene: String,
}

impl Files {
    /// Ends with the run, or, nothing more being written, when that is dropped.
    fn work(mut self, queue: &Receiver<Job>, speaker: &Sender<News>) -> miette::Result<()> {
        // The first checkpoint tells whether there is a disk to write to.
        let mut ahead = false;
        for job in queue {
            let news = match job {
                Job::Frame(frame) => {
                    // Frames of one simulation agree in their fields by construction.
                    self.writer.push(frame).expect("frames agree");
                    // Once that has failed, only the next checkpoint tries again.
                    let drafted = if ahead { self.writer.draft() } else { Ok(()) };
                    drafted.err().map(|error| {
                        ahead = false;
                        News::Failed(error.into())
                    })
                }
                Job::Save(state) => {
                    let start = Instant::now();
                    let saved = self.save(&state);
                    ahead = saved.is_ok();
                    Some(News::Saved(saved.map(|()| start.elapsed())))
                }
                Job::Finish { status, wall_time } => {
                    self.note(&wall_time);
                    return Ok(self.writer.finish(&status)?);
                }
            };
            if let Some(news) = news {
                // Whoever has left does not listen.
                let _ = speaker.send(news);
            }
        }
        Ok(())
    }

    fn save(&mut self, state: &State) -> miette::Result<()> {
        self.note(&state.wall_time);
        self.writer.commit()?;
        Ok(checkpoint::write(&self.checkpoint, &self.scene, state)?)
    }

    fn note(&mut self, wall_time: &BTreeMap<String, f64>) {
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
    fn start(directory: &Path) -> (Simulation, Output) {
        let simulation = Simulation::new(Scene::parse(SCENE, "scene.toml").unwrap()).unwrap();
        let (header, points) = (simulation.header(String::new()), simulation.static_points());
        let writer = TrajectoryWriter::create(&directory.join("run.h5"), &header, &points).unwrap();
        let mut output = Output::new(writer, directory.join("run.ckpt"), SCENE.to_owned());
        output.push(simulation.frame());
        (simulation, output)
    }

    /// Advances to the next frame and hands it over.
    fn next_frame(simulation: &mut Simulation, output: &mut Output) {
        (0..simulation.scene.steps_per_frame()).for_each(|_| simulation.advance().unwrap());
        output.push(simulation.frame());
    }

    /// The outcome of the checkpoint that is being written.
    fn saved(output: &mut Output) -> miette::Result<Duration> {
        while let Some(news) = output.news(true) {
            if let News::Saved(saved) = news {
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
            output.save(simulation.state.clone());
            // The run goes on while the files are written.
            next_frame(&mut simulation, &mut output);
            saved(&mut output).unwrap();
            let state = checkpoint::read(&directory.path().join("run.ckpt"), SCENE).unwrap();
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
    fn a_failure_is_told_at_once_and_the_next_checkpoint_has_all_frames() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("run.h5");
        let (mut simulation, mut output) = start(directory.path());
        output.save(simulation.state.clone());
        saved(&mut output).unwrap();

        // The file to add to is away for a while.
        let aside = directory.path().join("aside.h5");
        std::fs::rename(&path, &aside).unwrap();
        next_frame(&mut simulation, &mut output);
        let news = output.news.recv().unwrap();
        let News::Failed(report) = news else { panic!("no failure") };
        assert!(report.to_string().contains("run.h5"), "{report}");
        output.save(simulation.state.clone());
        let report = saved(&mut output).unwrap_err();
        assert!(report.to_string().contains("run.h5"), "{report}");

        std::fs::rename(&aside, &path).unwrap();
        assert_eq!(Trajectory::open(&path).unwrap().frames(), 1);
        next_frame(&mut simulation, &mut output);
        output.save(simulation.state.clone());
        saved(&mut output).unwrap();
        assert_eq!(Trajectory::open(&path).unwrap().frames(), 3);

        std::fs::rename(&path, &aside).unwrap();
        let end = output.finish("finished".to_owned(), BTreeMap::new());
        assert!(end.unwrap_err().to_string().contains("run.h5"));
    }
}
