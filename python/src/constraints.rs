//! Walls, boxes and plate of a scene, which confine the points of a rollout.

use dempm::scene::Scene;
use miette::Report;
use pyo3::prelude::*;
use surrogate::features::Obstacle;

use crate::failure::exception;

/// Walls, boxes and plate of a scene.
#[pyclass(frozen)]
pub struct Constraints(surrogate::rollout::Constraints);

#[pymethods]
impl Constraints {
    #[new]
    fn new(scene: &str, name: &str) -> PyResult<Self> {
        let scene = Scene::parse(scene, name).map_err(|error| exception(&Report::new(error)))?;
        Ok(Self(surrogate::rollout::Constraints::new(&scene)))
    }

    /// The boxes as a network sees them in windows whose newest frame is at `time` (s), with frames `interval` (s)
    /// apart: lower and upper corner while they rest (m), velocity when they move (m/frame), frames that they have
    /// been moving for, friction coefficients of left, right, bottom and top face. 11 numbers each.
    fn obstacles(&self, time: f64, interval: f64) -> Vec<Vec<f64>> {
        let numbers = |Obstacle { corners, velocity, elapsed, friction }: &Obstacle| {
            let moving = velocity.iter().chain([elapsed]).copied();
            let friction = friction.iter().map(|&mu| f64::from(mu));
            corners.iter().flatten().copied().chain(moving).chain(friction).collect()
        };
        self.0.obstacles(time, interval).iter().map(numbers).collect()
    }

    /// Moves points (m) that went from `old` to `new` between two `times` (s) out of walls and boxes.
    fn confine(&self, old: Vec<[f64; 2]>, new: Vec<[f64; 2]>, times: [f64; 2]) -> Vec<[f64; 2]> {
        old.iter().zip(new).map(|(&old, new)| self.0.confine(old, new, times)).collect()
    }
}
