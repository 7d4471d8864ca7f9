//! Sums over the processes that train one network.

use gpu::ranks::RanksError;

/// Sums over all processes (ranks) of a training.
pub trait AllReduce {
    /// Number of this process, from 0.
    fn rank(&self) -> usize;

    /// Number of processes.
    fn ranks(&self) -> usize;

    /// Replaces values by their sums over all processes, with the same bits on each.
    ///
    /// # Errors
    /// If another process is gone.
    fn sum(&mut self, values: &mut [f32]) -> Result<(), RanksError>;

    /// Marks the end of the training: every process may exit now.
    fn done(&mut self) {}

    /// Whether `own` is true on any process.
    ///
    /// # Errors
    /// As [`sum`](Self::sum).
    fn any(&mut self, own: bool) -> Result<bool, RanksError> {
        let mut number = [f32::from(u8::from(own))];
        self.sum(&mut number)?;
        Ok(number[0] > 0.0)
    }

    /// Whether all processes have the same hash: each byte then equals the mean over all.
    ///
    /// # Errors
    /// As [`sum`](Self::sum).
    fn all_equal(&mut self, own: &[u8; 32]) -> Result<bool, RanksError> {
        let own = own.map(f32::from);
        let mut sums = own;
        self.sum(&mut sums)?;
        let ranks = self.ranks() as f32;
        Ok(own.iter().zip(sums).all(|(byte, sum)| byte * ranks == sum))
    }
}

/// A single process: its sums are its own values.
pub struct SingleProcess;

impl AllReduce for SingleProcess {
    fn rank(&self) -> usize {
        0
    }

    fn ranks(&self) -> usize {
        1
    }

    fn sum(&mut self, _: &mut [f32]) -> Result<(), RanksError> {
        Ok(())
    }
}
