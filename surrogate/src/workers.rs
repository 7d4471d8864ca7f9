//! Many rollouts, or groups of them, at a time: on a GPU on streams of their own, on the CPU on threads.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::simulator::Simulator;

/// Pieces of work at a time on a GPU: while some are computed there, others read, write or start.
const ON_A_GPU: usize = 8;

/// Work that could not be shared out.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum WorkersError {
    /// A GPU gives no further stream.
    #[error(transparent)]
    Gpu(#[from] gpu::Error),
    /// The threads cannot be started.
    #[error("cannot start threads")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// The results of `work` on all items, in their order. Each call has a simulator on a stream of its own, or on a
/// share of the processor's threads; results do not depend on how many there are.
///
/// # Errors
/// If a stream or a thread cannot be had.
pub fn for_all<T: Sync, R: Send>(
    simulator: &Simulator,
    items: &[T],
    work: impl Fn(&Simulator, &T) -> R + Sync,
) -> Result<Vec<R>, WorkersError> {
    let threads = rayon::current_num_threads();
    let most = if simulator.gpu.is_some() { ON_A_GPU } else { threads };
    let workers = most.min(items.len()).max(1);
    let next = AtomicUsize::new(0);
    let results = Mutex::new(Vec::with_capacity(items.len()));
    let (next, done, work) = (&next, &results, &work);
    std::thread::scope(|scope| {
        let mut ready = Vec::new();
        for _ in 0..workers {
            let gpu = simulator.gpu.as_ref().map(|gpu| gpu.with_own_stream()).transpose()?;
            let own = Simulator { gpu, ..simulator.clone() };
            let threads = (threads / workers).max(1);
            ready.push((own, rayon::ThreadPoolBuilder::new().num_threads(threads).build()?));
        }
        for (own, pool) in ready {
            let all = move || {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(item) = items.get(index) else { return };
                    let result = work(&own, item);
                    // A poisoned lock means that another worker panicked, which ends the program.
                    if let Ok(mut done) = done.lock() {
                        done.push((index, result));
                    }
                }
            };
            scope.spawn(move || pool.install(all));
        }
        Ok::<_, WorkersError>(())
    })?;
    let mut results = results.into_inner().unwrap_or_default();
    results.sort_by_key(|(index, _)| *index);
    Ok(results.into_iter().map(|(_, result)| result).collect())
}
