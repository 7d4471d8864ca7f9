//! The material of a scene as networks see it.

use dempm::scene::Scene;
use miette::Report;
use pyo3::prelude::*;

use crate::failure::exception;

/// What a network may know of the material of a scene ([`surrogate::features::material`](fn@surrogate::features::material)).
#[pyfunction]
pub fn material(scene: &str, name: &str) -> PyResult<[f32; 4]> {
    let scene = Scene::parse(scene, name).map_err(|error| exception(&Report::new(error)))?;
    Ok(surrogate::features::material(&scene))
}
