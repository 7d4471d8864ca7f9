//! Batches prepared on other threads while the network learns from earlier ones.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel, sync_channel};
use std::thread;

use super::{DataError, DataSet, Examples, Recipe};

/// Smallest number of batches prepared ahead; otherwise as many as there are threads.
const AHEAD: usize = 3;

/// Prepares batches ahead of time, in order, until dropped.
pub struct Prefetch<T> {
    batches: Receiver<Receiver<Result<T, DataError>>>,
}

impl<T: Send + 'static> Prefetch<T> {
    /// Starts with the examples of `step`, which `prepare` turns into batches; several at a time.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn start(
        data: DataSet,
        recipe: Recipe,
        step: u64,
        prepare: impl Fn(Examples) -> T + Send + Sync + 'static,
    ) -> Result<Self, DataError> {
        let (send, batches) = sync_channel(rayon::current_num_threads().max(AHEAD));
        let mut sampler = recipe.sampler(&data)?;
        let maker = Arc::new((data, recipe, prepare));
        thread::spawn(move || {
            for step in step.. {
                let (done, batch) = channel();
                let windows = maker.1.windows(&mut sampler, step);
                let maker = Arc::clone(&maker);
                rayon::spawn(move || {
                    let (data, recipe, prepare) = &*maker;
                    // No receiver once the training has ended.
                    drop(done.send(recipe.examples(data, &windows, step).map(prepare)));
                });
                // The training has ended.
                if send.send(batch).is_err() {
                    break;
                }
            }
        });
        Ok(Self { batches })
    }

    /// Waits for the next batch; `None` if a thread panicked.
    ///
    /// # Errors
    /// If a file could not be read.
    pub fn next(&self) -> Result<Option<T>, DataError> {
        let batch = self.batches.recv().ok().and_then(|batch| batch.recv().ok());
        batch.transpose()
    }
}
