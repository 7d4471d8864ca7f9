//! All scenes of the lists, several at a time.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use dempm::choose::{self, Case};
use dempm::scene::Scene;
use files::{Interrupt, note, write_text};
use miette::{IntoDiagnostic, WrapErr, miette};
use rayon::ThreadPoolBuilder;

use super::measure::measure;
use crate::run_cache::hash;

/// A scene to measure.
pub struct Named {
    /// Its name in the table.
    pub name: String,
    /// The scene.
    pub scene: Scene,
}

/// How the scenes are run.
pub struct Options {
    /// GPUs to run on; none for the CPU.
    pub devices: Vec<Arc<gpu::Device>>,
    /// Scenes at a time on each device.
    pub jobs: usize,
    /// Seeds of the discs.
    pub seeds: u64,
    /// Time after which no scene is begun.
    pub budget: Option<Duration>,
}

/// The work of all threads.
struct Queue<'a> {
    open: Vec<&'a Named>,
    next: AtomicUsize,
    table: Mutex<Vec<Case>>,
    path: &'a Path,
    seeds: u64,
    until: Option<Instant>,
    interrupt: &'a Interrupt,
}

/// Measures the scenes that the table at `path` lacks. The table is written after each.
///
/// # Errors
/// If the table cannot be read, a device cannot be used or the table cannot be written. Scenes that fail are
/// noted, and left out.
pub fn run(
    scenes: &[Named],
    path: &Path,
    options: &Options,
    interrupt: &Interrupt,
) -> miette::Result<usize> {
    let table = if path.exists() { read(path)? } else { Vec::new() };
    let is_open = |scene: &&Named| table.iter().all(|row| row.scene != scene.name);
    let mut open: Vec<&Named> = scenes.iter().filter(is_open).collect();
    // Without an order of kinds and sizes, so that what fits into a budget is like the whole.
    open.sort_by_key(|scene| hash(&[&scene.name]));
    let devices: Vec<Option<&Arc<gpu::Device>>> = match &options.devices[..] {
        [] => vec![None],
        gpus => gpus.iter().map(Some).collect(),
    };
    let workers = (devices.len() * options.jobs).min(open.len().max(1));
    let threads = (rayon::current_num_threads() / workers).max(1);
    let queue = Queue {
        open,
        next: AtomicUsize::new(0),
        table: Mutex::new(table),
        path,
        seeds: options.seeds,
        until: options.budget.map(|budget| Instant::now() + budget),
        interrupt,
    };
    std::thread::scope(|scope| {
        let mut started = Vec::new();
        for worker in 0..workers {
            let device = devices[worker % devices.len()];
            let device = device.map(|gpu| gpu.with_own_stream()).transpose().into_diagnostic()?;
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().into_diagnostic()?;
            let queue = &queue;
            started.push(scope.spawn(move || pool.install(|| queue.work(device.as_ref()))));
        }
        for thread in started {
            thread.join().map_err(|_| miette!("a thread stopped"))??;
        }
        Ok::<(), miette::Report>(())
    })?;
    let table = queue.table.into_inner().map_err(|_| miette!("a thread stopped"))?;
    Ok(scenes.iter().filter(|scene| table.iter().any(|row| row.scene == scene.name)).count())
}

/// Reads a table of measured cases.
///
/// # Errors
/// If it cannot be read or has another form.
pub fn read(path: &Path) -> miette::Result<Vec<Case>> {
    let what = || format!("cannot read {}", path.display());
    let text = std::fs::read_to_string(path).into_diagnostic().wrap_err_with(what)?;
    choose::read(&text).map_err(|why| miette!("{}: {why}", path.display()))
}

impl Queue<'_> {
    /// Measures scenes until none is left or the time is up.
    fn work(&self, device: Option<&Arc<gpu::Device>>) -> miette::Result<()> {
        let is_over = || self.until.is_some_and(|until| Instant::now() >= until);
        while !self.interrupt.requested() && !is_over() {
            let next = self.next.fetch_add(1, Ordering::Relaxed);
            let Some(Named { name, scene }) = self.open.get(next) else { return Ok(()) };
            let folder = tempfile::tempdir().into_diagnostic()?;
            let began = Instant::now();
            match measure(name, scene, self.seeds, device, folder.path(), self.interrupt) {
                Ok(rows) => {
                    self.add(rows)?;
                    note!("{name}: {:.1} s", began.elapsed().as_secs_f64());
                }
                Err(_) if self.interrupt.requested() => {}
                Err(why) => note!("{name} is left out: {why}"),
            }
        }
        Ok(())
    }

    fn add(&self, rows: Vec<Case>) -> miette::Result<()> {
        let mut table = self.table.lock().map_err(|_| miette!("a thread stopped"))?;
        table.extend(rows);
        table.sort_by(|a, b| a.scene.cmp(&b.scene));
        let lines = std::iter::once(choose::head()).chain(table.iter().map(Case::line));
        write_text(self.path, &(lines.collect::<Vec<_>>().join("\n") + "\n"))?;
        Ok(())
    }
}
