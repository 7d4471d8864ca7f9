//! Progress and warnings of a session.

use super::error::SessionError;
use crate::simulation::Simulation;
use crate::trajectory::Frame;

/// Receives progress and warnings of a session; the default methods ignore them.
pub trait Observer {
    /// The packings of the scene are being prepared.
    fn preparing(&mut self) {}

    /// The simulation is ready to advance from its present step.
    fn ready(&mut self, simulation: &Simulation) {
        let _ = simulation;
    }

    /// The simulation has advanced from step `before`; `frame` is given if that completed one.
    fn advanced(&mut self, simulation: &Simulation, before: usize, frame: Option<&Frame>) {
        let _ = (simulation, before, frame);
    }

    /// The monitor warns.
    fn warning(&mut self, text: &str) {
        let _ = text;
    }

    /// Frames or a checkpoint could not be written; the session goes on and tries again later.
    fn write_failed(&mut self, error: SessionError) {
        let _ = error;
    }

    /// The session advances no further.
    fn finished(&mut self) {}
}

/// Ignores everything.
impl Observer for () {}
