//! Running the scenes of a data set, several at a time.

use std::cmp::Reverse;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Report};

use super::{Case, DatasetError};
use crate::checkpoint;
use crate::sitting::{self, Outcome, sit};
use crate::trajectory::Trajectory;

/// How the scenes are run.
pub struct Options {
    /// GPUs that advance RVEs; none: the CPU.
    pub devices: Vec<Arc<gpu::Device>>,
    /// Scenes at a time on each of them.
    pub jobs: usize,
    pub overwrite: bool,
    pub checkpoint_interval: Duration,
}

/// How it ended.
pub enum Done {
    All,
    Interrupted,
    /// These scenes failed; the others are done.
    Failed(Vec<String>),
}

/// Runs all cases that are not complete yet into `folder`.
///
/// # Errors
/// Trajectories of other scenes in the way, or no threads.
pub fn run(
    cases: &[Case],
    folder: &Path,
    options: &Options,
    interrupted: &AtomicBool,
) -> miette::Result<Done> {
    let (mut open, mut failed) = (Vec::new(), Vec::new());
    for case in cases {
        let complete = if options.overwrite { Ok(false) } else { is_complete(case, folder) };
        match complete {
            Ok(true) => {}
            Ok(false) => open.push(case),
            // One damaged file is no reason not to make the others.
            Err(error @ DatasetError::Damaged { .. }) => {
                failed.push(case.split.case(&case.name));
                eprintln!("{:?}", Report::new(error));
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
    let skipped = cases.len() - open.len() - failed.len();
    if skipped > 0 {
        eprintln!("{skipped} of {} scenes are complete", cases.len());
    }
    let queue = Queue {
        open: &open,
        next: AtomicUsize::new(0),
        failed: Mutex::new(failed),
        bars: MultiProgress::new(),
        total: total_bar(&open),
    };
    queue.bars.add(queue.total.clone());
    let threads = (rayon::current_num_threads() / workers).max(1);
    std::thread::scope(|scope| {
        let mut pools = Vec::new();
        for worker in 0..workers {
            // Device by device, so that no GPU waits while another has two scenes.
            let device = devices[worker % devices.len()].as_ref();
            let device = device.map(|gpu| gpu.with_own_stream()).transpose().into_diagnostic()?;
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pools.push((pool.into_diagnostic()?, device));
        }
        for (pool, device) in pools {
            let queue = &queue;
            scope.spawn(move || {
                pool.install(|| queue.work(folder, device.as_ref(), options, interrupted));
            });
        }
        Ok::<_, Report>(())
    })?;
    queue.total.finish_and_clear();
    let failed = queue.failed.into_inner().unwrap_or_default();
    Ok(if interrupted.load(Ordering::Relaxed) {
        Done::Interrupted
    } else if failed.is_empty() {
        Done::All
    } else {
        Done::Failed(failed)
    })
}

/// Scenes that wait, and what became of the others.
struct Queue<'a> {
    open: &'a [&'a Case],
    next: AtomicUsize,
    failed: Mutex<Vec<String>>,
    bars: MultiProgress,
    total: ProgressBar,
}

impl Queue<'_> {
    /// Takes scenes until none is left.
    fn work(
        &self,
        folder: &Path,
        device: Option<&Arc<gpu::Device>>,
        options: &Options,
        interrupted: &AtomicBool,
    ) {
        while !interrupted.load(Ordering::Relaxed) {
            let Some(case) = self.open.get(self.next.fetch_add(1, Ordering::Relaxed)) else {
                return;
            };
            let output = case.file(folder);
            // A checkpoint alone, whose trajectory someone has deleted, is of no use either.
            let resume =
                !options.overwrite && output.exists() && checkpoint::path_beside(&output).exists();
            let sitting = sitting::Options {
                device: device.cloned(),
                ranks: None,
                resume,
                // Without a checkpoint a file that is not complete is of no use.
                overwrite: !resume,
                checkpoint_interval: options.checkpoint_interval,
                bars: self.bars.clone(),
                total: Some(self.total.clone()),
            };
            let name = case.split.case(&case.name);
            match sit(case.scene.clone(), output, &sitting, interrupted) {
                Ok(Outcome::Finished(_)) => self.say(&format!("{name} done")),
                Ok(Outcome::Interrupted { step, steps }) => {
                    self.say(&format!("{name} interrupted at step {step} of {steps}"));
                }
                Err(report) => {
                    self.say(&format!("{name} failed: {report:?}"));
                    // A poisoned lock means that another worker panicked, which ends the program.
                    if let Ok(mut failed) = self.failed.lock() {
                        failed.push(name);
                    }
                }
            }
        }
    }

    fn say(&self, line: &str) {
        self.bars.suspend(|| eprintln!("{line}"));
    }
}

fn total_bar(open: &[&Case]) -> ProgressBar {
    let bar = ProgressBar::new(open.iter().map(|case| case.work()).sum());
    let style = ProgressStyle::with_template("{prefix:<20} {bar:24} {percent:>3} %  {eta} left");
    bar.set_style(style.expect("the template is valid"));
    bar.set_prefix(format!("{} scenes", open.len()));
    bar
}

/// Whether the trajectory of a case is there and finished.
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
