//! Several processes that train one network: each learns from its own windows of every step, and
//! the sums of their gradients move the weights of all of them alike.

use std::sync::Arc;

use gpu::Device;
use gpu::ranks::{Environment, Fingerprint, Ranks, RanksError};

use super::tcp::Tcp;

/// Sums over all processes of a training.
pub trait AllReduce {
    /// Which process this is, from 0.
    fn rank(&self) -> usize;

    /// How many there are.
    fn ranks(&self) -> usize;

    /// Replaces numbers by their sums over all processes, the same bits on each.
    ///
    /// # Errors
    /// If another process is gone.
    fn sum(&mut self, values: &mut [f32]) -> Result<(), RanksError>;

    /// All processes have come to the end, and each may end.
    fn done(&mut self) {}

    /// Whether any process says so.
    ///
    /// # Errors
    /// As [`sum`](Self::sum).
    fn any(&mut self, own: bool) -> Result<bool, RanksError> {
        let mut number = [f32::from(u8::from(own))];
        self.sum(&mut number)?;
        Ok(number[0] > 0.0)
    }

    /// Whether all processes have the same hash: each byte is the mean of those of all.
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

/// One process.
pub struct Alone;

impl AllReduce for Alone {
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

/// Processes with a GPU each.
impl AllReduce for Arc<Ranks> {
    fn rank(&self) -> usize {
        Ranks::rank(self)
    }

    fn ranks(&self) -> usize {
        self.size()
    }

    fn sum(&mut self, values: &mut [f32]) -> Result<(), RanksError> {
        self.sum_on_host(values)
    }

    fn done(&mut self) {
        self.all_done();
    }
}

/// How sums are made on the host, and the GPUs that make them among themselves, if there are any.
pub type Joined = (Box<dyn AllReduce>, Option<Arc<Ranks>>);

/// Joins the other ranks, if there are any, who are about to train what has the same
/// fingerprint. Those with a GPU are given as GPUs too.
///
/// # Errors
/// If they do not meet, or train different things.
pub fn join(
    environment: Environment,
    device: Option<&Arc<Device>>,
    fingerprint: &Fingerprint,
) -> Result<Joined, RanksError> {
    match device {
        _ if !environment.is_shared() => Ok((Box::new(Alone), None)),
        None => Ok((Box::new(Tcp::join(environment, fingerprint)?), None)),
        Some(device) => {
            let gpus = Arc::new(Ranks::join(&environment, device, fingerprint)?);
            Ok((Box::new(gpus.clone()), Some(gpus)))
        }
    }
}
