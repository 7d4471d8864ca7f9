//! Running a scene into a trajectory file that survives interruptions.
//!
//! [`run_scene`] advances a [`Simulation`](crate::simulation::Simulation) from the start or a
//! [`checkpoint`] to the end. A thread of its own writes frames and checkpoints, a
//! [`Monitor`] looks for states outside the validity of the method, and an [`Observer`] receives
//! progress and warnings.

pub mod checkpoint;
mod error;
pub mod monitor;
mod observer;
mod rest;
mod session;
mod writer_thread;

pub use checkpoint::interval as checkpoint_interval;
pub use error::{SessionError, WriterError};
pub use monitor::Monitor;
pub use observer::Observer;
pub use session::{Options, Outcome, run_scene};
