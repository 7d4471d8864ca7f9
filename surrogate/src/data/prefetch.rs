//! Batches made on other threads while the model learns from earlier ones.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel, sync_channel};
use std::thread;

use super::{DataError, DataSet, Draft, Recipe};

/// Batches that wait or are being made, at least; as many as there are threads to make them.
const AHEAD: usize = 3;

/// Makes batches ahead of time, in order. The thread ends when this is dropped.
pub struct Prefetch<T> {
    batches: Receiver<Receiver<Result<T, DataError>>>,
}

impl<T: Send + 'static> Prefetch<T> {
    /// Begins with the examples of `step`; `prepare` is the last thing done. Several batches are made
    /// at a time.
    pub fn start(
        data: DataSet,
        recipe: Recipe,
        step: u64,
        prepare: impl Fn(Draft) -> T + Send + Sync + 'static,
    ) -> Self {
        let (send, batches) = sync_channel(rayon::current_num_threads().max(AHEAD));
        let mut order = recipe.order(&data);
        let maker = Arc::new((data, recipe, prepare));
        thread::spawn(move || {
            for step in step.. {
                let (done, batch) = channel();
                let windows = maker.1.windows(&mut order, step);
                let maker = Arc::clone(&maker);
                rayon::spawn(move || {
                    let (data, recipe, prepare) = &*maker;
                    // Nobody waits for a batch after the training ended.
                    drop(done.send(recipe.draft(data, &windows, step).map(prepare)));
                });
                // Nobody listens any more once the training ends.
                if send.send(batch).is_err() {
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
        let batch = self.batches.recv().ok().and_then(|batch| batch.recv().ok());
        batch.transpose()
    }
}
