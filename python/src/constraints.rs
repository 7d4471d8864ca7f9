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

    /// Lower and upper corners of the fixed boxes, m.
    fn obstacles(&self) -> Vec<Obstacle> {
        self.0.obstacles()
    }

    /// Moves points (m) that went from `old` to `new` between two `times` (s) out of walls and boxes.
    fn confine(&self, old: Vec<[f64; 2]>, new: Vec<[f64; 2]>, times: [f64; 2]) -> Vec<[f64; 2]> {
        old.iter().zip(new).map(|(&old, new)| self.0.confine(old, new, times)).collect()
    }
}
