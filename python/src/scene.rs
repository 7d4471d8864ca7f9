//! Scenes as values of Python and as TOML; JSON lies between the two.

use dempm::scene::{Material, Scene};
use miette::{IntoDiagnostic, Report, miette};
use pyo3::prelude::*;
use serde_json::{Value, json};

use crate::failure::exception;

/// The values of a text in TOML, as JSON.
#[pyfunction]
pub fn toml_values(text: &str) -> PyResult<String> {
    values(text).map(|values| values.to_string()).map_err(|report| exception(&report))
}

/// Values in JSON as a text in TOML.
#[pyfunction]
pub fn toml_text(values: &str) -> PyResult<String> {
    let values: Result<Value, _> = serde_json::from_str(values).into_diagnostic();
    values
        .and_then(|values| {
            let text = toml::to_string(&values);
            text.map_err(|error| {
                miette!(
                    "this dictionary cannot be a scene: {error}; leave out keys whose value is None"
                )
            })
        })
        .map_err(|report| exception(&report))
}

/// The values of a scene, as JSON: those of its text, and the defaults of keys that it leaves out at the top, in
/// `domain`, `grains` and `rve`.
#[pyfunction]
pub fn scene_values(text: &str, name: &str) -> PyResult<String> {
    complete(text, name).map(|values| values.to_string()).map_err(|report| exception(&report))
}

fn values(text: &str) -> miette::Result<Value> {
    toml::from_str(text).into_diagnostic()
}

fn complete(text: &str, name: &str) -> miette::Result<Value> {
    let scene = Scene::parse(text, name).map_err(Report::new)?;
    let mut defaults = json!({
        "title": scene.title,
        "seed": scene.seed,
        "gravity": scene.gravity,
        "duration": scene.duration,
        "step": scene.step,
        "frame_interval": scene.frame_interval,
        "domain": {
            "size": scene.domain.size,
            "cell": scene.domain.cell,
            "points_per_cell": scene.domain.points_per_cell,
        },
        "material": { "kind": scene.material.name() },
    });
    if let Some(grains) = scene.material.grains() {
        defaults["grains"] = serde_json::to_value(grains).into_diagnostic()?;
    }
    if let Material::Rve(rve) = &scene.material {
        let mut parameters = serde_json::to_value(&rve.parameters).into_diagnostic()?;
        // They have a table of their own.
        parameters.as_object_mut().map(|table| table.remove("grains"));
        defaults["rve"] = parameters;
    }
    let mut all = values(text)?;
    fill(&mut all, defaults);
    Ok(all)
}

/// Adds the keys of `defaults` that `values` lacks.
fn fill(values: &mut Value, defaults: Value) {
    let (Value::Object(values), Value::Object(defaults)) = (values, defaults) else { return };
    for (key, default) in defaults {
        match values.get_mut(&key) {
            Some(value) => fill(value, default),
            None => _ = values.insert(key, default),
        }
    }
}
