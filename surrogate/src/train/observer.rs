//! Progress of a training.

/// Follows a training step by step.
pub trait TrainObserver {
    /// `step` steps are made.
    fn step(&mut self, step: u64);

    /// A row of the log: the mean loss since the last one, and the best validation MSE (box²) so
    /// far.
    fn logged(&mut self, loss: f64, best: Option<f64>);
}
