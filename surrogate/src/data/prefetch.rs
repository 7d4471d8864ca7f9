//! Batches made on other threads while the model learns from earlier ones.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel, sync_channel};
use std::thread;

use super::{DataError, DataSet, Draft, Order, Recipe};

/// Batches that wait or are being made, at least; as many as there are threads to make them.
const AHEAD: usize = 3;

/// Makes batches ahead of time, in order. The thread ends when this is dropped.
pub struct Prefetch<T> {
    batches: Receiver<Result<Receiver<T>, DataError>>,
}

impl<T: Send + 'static> Prefetch<T> {
    /// Begins with the examples of `step`; `prepare` is the last thing done, for several batches at
    /// a time.
    pub fn start(
        data: DataSet,
        recipe: Recipe,
        step: u64,
        prepare: impl Fn(Draft) -> T + Send + Sync + 'static,
    ) -> Self {
        let (send, batches) = sync_channel(rayon::current_num_threads().max(AHEAD));
        let prepare = Arc::new(prepare);
        thread::spawn(move || {
            let mut order = Order::new(recipe.seed, data.len());
            for step in step.. {
                let batch = recipe.draft(&data, &mut order, step).map(|draft| {
                    let (done, prepared) = channel();
                    let prepare = Arc::clone(&prepare);
                    // Nobody waits for a batch after the training ended.
                    rayon::spawn(move || drop(done.send(prepare(draft))));
                    prepared
                });
                let failed = batch.is_err();
                // Nobody listens any more once the training ends.
                if send.send(batch).is_err() || failed {
                    break;
                }
            }
        });
        Self { batches }
    }

    /// Waits for the next batch; `None` if the thread died.
    ///
    /// # Errors
    /// If a file could not be read.
    pub fn next(&self) -> Result<Option<T>, DataError> {
        let prepared = self.batches.recv().ok().transpose()?;
        Ok(prepared.and_then(|batch| batch.recv().ok()))
    }
}
