//! The cost of a scene.

use dempm::check::{Needs, disc_steps_per_second};
use dempm::scene::Scene;
use miette::IntoDiagnostic;
use pyo3::prelude::*;
use serde_json::{Value, json};

use crate::failure::text;
use crate::supervisor::supervise;

/// The cost of a scene: numbers and warnings as JSON, and the report of `dempm check`.
#[pyfunction]
pub fn check(py: Python<'_>, scene: String, name: String) -> PyResult<(String, String)> {
    supervise(py, None, move |_, _| {
        let scene = Scene::parse(&scene, &name)?;
        let needs = Needs::of(&scene, disc_steps_per_second().into_diagnostic()?);
        Ok((numbers(&scene, &needs).to_string(), needs.to_string()))
    })
}

fn numbers(scene: &Scene, needs: &Needs) -> Value {
    let doubts = scene.warning_report().map(|report| text(&report));
    json!({
        "points": needs.points,
        "frames": needs.frames,
        "steps": needs.steps,
        "step": needs.step,
        "step_limit": needs.step_limit,
        "discs": needs.dem.as_ref().map(|dem| dem.discs),
        "seconds": needs.seconds,
        "memory": needs.memory,
        "output": needs.output,
        "warnings": doubts.into_iter().chain(needs.warnings.iter().cloned()).collect::<Vec<_>>(),
    })
}
