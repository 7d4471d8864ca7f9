//! Several processes (ranks) that work together, one on each GPU, joined by NCCL. [`Environment`] and
//! [`rendezvous`] serve ranks without GPUs too.

mod communicator;
mod environment;
mod error;
mod rendezvous;
mod watchdog;

pub use communicator::{Ranks, Reduction};
pub use environment::{Environment, EnvironmentError};
pub use error::RanksError;
pub use rendezvous::{Fingerprint, rendezvous};
