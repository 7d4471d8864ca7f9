//! Loss and validation error over the steps of a training.

use std::path::Path;

use surrogate::simulator::Simulator;

use crate::context::Context;
use crate::difference::errors_if_held;
use crate::folder::files_in;
use crate::models::Model;
use crate::studies::rollouts::{Rollout, roll_out};
use crate::studies::statistics::mean;

/// Simulated time (s) that intermediate weights predict.
const HORIZON: f64 = 1.5;

/// Curves of a model over its training steps; empty where nothing is known.
pub struct TrainingCurves {
    /// The model.
    pub model: Model,
    /// Steps and mean MSE of validation rollouts, box width 1.
    pub validation: Vec<(f64, f64)>,
    /// Steps and loss.
    pub loss: Vec<(f64, f64)>,
}

/// The curves of all models: from their logs, or else from rollouts of intermediate weights.
///
/// # Errors
/// If weights cannot be read, a rollout cannot be made or the user interrupts.
pub fn measure(context: &mut Context) -> miette::Result<Vec<TrainingCurves>> {
    let mut curves = Vec::new();
    for model in context.models.clone() {
        let logged = curve(&model.log("validation.csv"), "mse");
        let validation = match logged.filter(|points| points.len() > 1) {
            Some(points) => points,
            None => of_intermediate_weights(context, &model)?,
        };
        let loss = curve(&model.log("log.csv"), "loss").unwrap_or_default();
        curves.push(TrainingCurves { model, validation, loss });
    }
    Ok(curves)
}

/// Steps and mean validation error of a model's intermediate weights and of itself; empty if there
/// are none, or no validation cases.
fn of_intermediate_weights(
    context: &mut Context,
    model: &Model,
) -> miette::Result<Vec<(f64, f64)>> {
    let folder = match model.path.ends_with("best.safetensors") {
        true => model.path.with_file_name("stages"),
        false => model.path.with_extension("stages"),
    };
    let (weights, cases) = (files_in(&folder, "safetensors"), context.cases("valid"));
    if weights.is_empty() || cases.is_empty() {
        return Ok(Vec::new());
    }
    let mut stages = Vec::new();
    for path in weights.into_iter().chain([model.path.clone()]) {
        let simulator = Simulator::load(&path)?;
        let steps = simulator.training.steps;
        let frames = (HORIZON / simulator.training.frame_interval).round() as usize + 1;
        let frames = Some(frames.max(simulator.first_frames() + 1));
        let name = format!("{}, step {steps}", model.name);
        stages.push((steps, Model { name, path, frames, ..model.clone() }));
    }
    stages.sort_by_key(|(steps, _)| *steps);
    stages.dedup_by_key(|(steps, _)| *steps);
    let models: Vec<Model> = stages.iter().map(|(_, stage)| stage.clone()).collect();
    let rollouts = roll_out(context, &models, &cases)?;
    let mut points = Vec::new();
    for (steps, stage) in &stages {
        let own = rollouts.iter().filter(|rollout| rollout.model == stage.name);
        let errors = own.map(error).collect::<miette::Result<Option<Vec<f64>>>>()?;
        let errors = errors.filter(|errors| !errors.is_empty());
        points.extend(errors.map(|errors| (*steps as f64, mean(&errors))));
    }
    Ok(points)
}

/// Mean error of a rollout until [`HORIZON`]; one that ended early stays in place. `None` if it did
/// not begin.
fn error(rollout: &Rollout) -> miette::Result<Option<f64>> {
    if rollout.is_refused() {
        return Ok(None);
    }
    let mut errors: Vec<f64> = rollout.errors.errors.iter().map(|error| error.mse).collect();
    errors.extend(errors_if_held(&rollout.output, &rollout.truth, HORIZON)?);
    Ok(Some(mean(&errors)))
}

/// Steps and one column of a log; `None` if there is no such file or column, or it is empty.
fn curve(path: &Path, column: &str) -> Option<Vec<(f64, f64)>> {
    let text = std::fs::read_to_string(path).ok()?;
    let mut lines = text.lines();
    let place = lines.next()?.split(',').position(|name| name == column)?;
    let point = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        Some((cells.first()?.parse().ok()?, cells.get(place)?.parse().ok()?))
    };
    let points: Vec<(f64, f64)> = lines.filter_map(point).collect();
    (!points.is_empty()).then_some(points)
}
