//! Several processes (ranks) that train one network: each learns from its own windows of every
//! step, and the summed gradients move the weights of all alike.

use std::sync::Arc;

use gpu::Device;
use gpu::ranks::{Environment, Fingerprint, Ranks, RanksError};

use super::all_reduce::{AllReduce, SingleProcess};
use super::tcp::Tcp;

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

/// Sums on the host, and the GPUs that sum among themselves, if there are any.
pub type Joined = (Box<dyn AllReduce>, Option<Arc<Ranks>>);

/// Joins the other processes of a training. All must have the same fingerprint of what they train. A long
/// wait is reported to `waiting` as by [`rendezvous`](gpu::ranks::rendezvous).
///
/// # Errors
/// If they do not rendezvous, or are about to train different things.
pub fn join(
    environment: Environment,
    device: Option<&Arc<Device>>,
    fingerprint: &Fingerprint,
    waiting: impl FnOnce(&str),
) -> Result<Joined, RanksError> {
    match device {
        _ if !environment.is_shared() => Ok((Box::new(SingleProcess), None)),
        None => Ok((Box::new(Tcp::join(environment, fingerprint, waiting)?), None)),
        Some(device) => {
            let gpus = Arc::new(Ranks::join(&environment, device, fingerprint, waiting)?);
            Ok((Box::new(gpus.clone()), Some(gpus)))
        }
    }
}
