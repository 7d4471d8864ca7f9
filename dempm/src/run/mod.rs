//! Running a scene into a trajectory file that survives interruptions.
//!
//! [`run_scene`] advances a [`Simulation`](crate::simulation::Simulation) from the start or a
//! [`checkpoint`] to the end. A [thread](writer_thread) of its own writes frames and checkpoints, a
//! [`Monitor`] looks for states outside the validity of the method, and an [`Observer`] receives
//! progress and warnings.

pub mod checkpoint;
pub mod monitor;
mod observer;
mod session;
mod summary;
mod writer_thread;

pub use monitor::Monitor;
pub use observer::Observer;
pub use session::{Options, Outcome, SessionError, run_scene};
pub use summary::Summary;
