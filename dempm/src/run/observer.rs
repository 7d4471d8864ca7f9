//! Progress and warnings of a session.

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

    /// A warning that does not stop the session: a sentence, or an error over several lines.
    fn warning(&mut self, text: &str) {
        let _ = text;
    }

    /// The session advances no further.
    fn finished(&mut self) {}
}

/// Ignores everything.
impl Observer for () {}
