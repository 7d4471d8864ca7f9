//! Runs the scenes of a data set, several at a time.

use std::cmp::Reverse;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use files::{FileLock, Interrupt};

use super::case::Case;
use super::error::DatasetError;
use crate::run::{self, Outcome, SessionError, checkpoint, run_scene};
use crate::trajectory::Trajectory;

/// How the scenes are run.
pub struct Options {
    /// GPUs to run on; none for the CPU.
    pub devices: Vec<Arc<gpu::Device>>,
    /// Scenes at a time on each device.
    pub jobs: usize,
    /// Run scenes again whose trajectories exist.
    pub overwrite: bool,
    /// Least pause between checkpoints of a scene.
    pub checkpoint_interval: Duration,
}

/// How it ended.
pub enum Done {
    /// All scenes are finished.
    All,
    /// The run was interrupted and can be continued.
    Interrupted,
    /// The scenes of these names failed; the others are finished.
    Failed(Vec<String>),
}

/// Receives the progress of all scenes.
pub trait Observer: Sync {
    /// `open` cases are to be run; the others of `all` are complete or damaged.
    fn begin(&self, open: &[&Case], all: usize, damaged: usize);

    /// The observer of one case.
    fn session(&self) -> Box<dyn run::Observer>;

    /// The trajectory of a case cannot be read.
    fn damaged(&self, error: DatasetError);

    /// The session of a case has ended.
    fn ended(&self, case: &Case, outcome: Result<Outcome, SessionError>);

    /// No further scene is run.
    fn finish(&self);
}

/// A data set that could not be run at all.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum SchedulerError {
    /// A trajectory is in the way.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Dataset(#[from] DatasetError),
    /// A GPU gives no further stream.
    #[error(transparent)]
    Gpu(#[from] gpu::Error),
    /// The threads of a job cannot be started.
    #[error("cannot start the threads of a job")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// Runs all cases that are not complete yet into `folder`.
///
/// # Errors
/// If trajectories of other scenes are in the way, or threads cannot be started.
pub fn run(
    cases: &[Case],
    folder: &Path,
    options: &Options,
    observer: &dyn Observer,
    interrupt: &Interrupt,
) -> Result<Done, SchedulerError> {
    let (mut open, mut failed) = (Vec::new(), Vec::new());
    for case in cases {
        let complete = if options.overwrite { Ok(false) } else { is_complete(case, folder) };
        match complete {
            Ok(true) => remove_traces(case, folder),
            Ok(false) => open.push(case),
            // A damaged file does not stop the others.
            Err(error @ DatasetError::Damaged { .. }) => {
                failed.push(case.full_name());
                observer.damaged(error);
            }
            Err(error) => return Err(error.into()),
        }
    }
    let devices: Vec<Option<Arc<gpu::Device>>> = match options.devices.as_slice() {
        [] => vec![None],
        gpus => gpus.iter().cloned().map(Some).collect(),
    };
    let workers = (devices.len() * options.jobs).min(open.len().max(1));
    if workers > 1 {
        // The longest first, so that the last ones to finish are short.
        open.sort_by_key(|case| Reverse(case.work()));
    }
    observer.begin(&open, cases.len(), failed.len());
    let queue = Queue {
        open: &open,
        next: AtomicUsize::new(0),
        failed: Mutex::new(failed),
        folder,
        options,
        observer,
        interrupt,
    };
    let threads = (rayon::current_num_threads() / workers).max(1);
    std::thread::scope(|scope| {
        let mut pools = Vec::new();
        for worker in 0..workers {
            // Round robin, so that no GPU idles while another has two scenes.
            let device = devices[worker % devices.len()].as_ref();
            let device = device.map(|gpu| gpu.with_own_stream()).transpose()?;
            pools.push((rayon::ThreadPoolBuilder::new().num_threads(threads).build()?, device));
        }
        for (pool, device) in pools {
            let queue = &queue;
            scope.spawn(move || pool.install(|| queue.work(device.as_ref())));
        }
        Ok::<_, SchedulerError>(())
    })?;
    observer.finish();
    let failed = queue.failed.into_inner().unwrap_or_default();
    Ok(if interrupt.requested() {
        Done::Interrupted
    } else if failed.is_empty() {
        Done::All
    } else {
        Done::Failed(failed)
    })
}

/// The cases to run, shared by all workers.
struct Queue<'a> {
    open: &'a [&'a Case],
    next: AtomicUsize,
    failed: Mutex<Vec<String>>,
    folder: &'a Path,
    options: &'a Options,
    observer: &'a dyn Observer,
    interrupt: &'a Interrupt,
}

impl Queue<'_> {
    /// Runs cases until none is left.
    fn work(&self, device: Option<&Arc<gpu::Device>>) {
        while !self.interrupt.requested() {
            let Some(case) = self.open.get(self.next.fetch_add(1, Ordering::Relaxed)) else {
                return;
            };
            let outcome = self.run(case, device);
            if outcome.is_err()
                // A poisoned lock means that another worker panicked, which ends the program.
                && let Ok(mut failed) = self.failed.lock()
            {
                failed.push(case.full_name());
            }
            self.observer.ended(case, outcome);
        }
    }

    fn run(&self, case: &Case, device: Option<&Arc<gpu::Device>>) -> Result<Outcome, SessionError> {
        let output = case.file(self.folder);
        // A checkpoint is of no use without its trajectory, nor an incomplete trajectory without its
        // checkpoint.
        let resume =
            !self.options.overwrite && output.exists() && checkpoint::path_beside(&output).exists();
        let options = run::Options {
            device: device.cloned(),
            ranks: None,
            resume,
            overwrite: !resume,
            checkpoint_interval: self.options.checkpoint_interval,
        };
        let mut observer = self.observer.session();
        run_scene(case.scene.clone(), output, &options, observer.as_mut(), self.interrupt)
    }
}

/// Removes what a process that was killed at the end of a run has left beside its finished trajectory.
fn remove_traces(case: &Case, folder: &Path) {
    let path = case.file(folder);
    let traces = [checkpoint::path_beside(&path), files::path_beside(&path, ".lock")];
    // With the lock, which removes itself: another process may just be about to do the same.
    if traces.iter().any(|trace| trace.exists())
        && let Ok(_lock) = FileLock::take(&path)
    {
        // It takes up space, nothing else.
        let _ = std::fs::remove_file(&traces[0]);
    }
}

/// Whether the trajectory of a case exists and is finished.
fn is_complete(case: &Case, folder: &Path) -> Result<bool, DatasetError> {
    let path = case.file(folder);
    if !path.exists() {
        return Ok(false);
    }
    let trajectory = Trajectory::open(&path)
        .map_err(|source| DatasetError::Damaged { path: path.clone(), source })?;
    if trajectory.header().scene != case.scene.text {
        return Err(DatasetError::OtherScene { path });
    }
    Ok(trajectory.status() == "finished")
}
