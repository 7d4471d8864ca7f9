//! The cost of a scene.

use std::path::PathBuf;

use dempm::check::{Needs, Rates};
use dempm::choose::Within;
use dempm::commands::choose::Chooser;
use dempm::device::Device;
use dempm::scene::Scene;
use miette::{IntoDiagnostic, miette};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use serde_json::{Value, json};
use surrogate::commands::expect_of;

use crate::failure::text;
use crate::supervisor::supervise;

/// The cost of a scene: numbers and warnings as JSON, and the report of `dempm check`.
#[pyfunction]
pub fn check(py: Python<'_>, scene: String, name: String) -> PyResult<(String, String)> {
    supervise(py, None, move |_, _| {
        let scene = Scene::parse(&scene, &name)?;
        let needs = Needs::of(&scene, &Rates::measure(false).into_diagnostic()?);
        Ok((numbers(&scene, &needs).to_string(), needs.to_string()))
    })
}

/// The model to take for a scene: the choice as JSON, the report of `dempm choose`, and the scene with that model.
#[pyfunction]
pub fn choose(
    py: Python<'_>,
    scene: String,
    name: String,
    within: &str,
    device: &str,
    learned: Option<PathBuf>,
) -> PyResult<(String, String, String)> {
    let within: Within = within
        .parse()
        .map_err(|error| PyValueError::new_err(format!("within = {within:?}; valid: {error}")))?;
    let device: Device = device
        .parse()
        .map_err(|error| PyValueError::new_err(format!("device = {device:?}; {error}")))?;
    supervise(py, None, move |_, _| {
        let scene = Scene::parse(&scene, &name)?;
        let on_gpu = device.open().into_diagnostic()?.is_some();
        let learned = learned.map(|model| expect_of(&model, &scene, device, false)).transpose()?;
        let choice = Chooser::new(on_gpu)?.choice(&scene, within, learned.as_ref())?;
        let chosen = choice.chosen_scene().map_err(|why| miette!("{name}: {why}"))?;
        let json = serde_json::to_string(&choice).into_diagnostic()?;
        Ok((json, choice.to_string(), chosen.text))
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
