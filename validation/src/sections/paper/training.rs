//! Fig. 8: training curves.

use std::path::{Path, PathBuf};

use surrogate::simulator::Simulator;

use crate::block::{Block, Figure};
use crate::chart::{Axis, Chart, Mark, Series};
use crate::context::{Context, Model, files_in};
use crate::rollouts::{Rollout, roll_out};
use crate::section::Section;

/// Loss and validation error over the steps of trainings.
pub struct Training;

impl Section for Training {
    fn title(&self) -> &'static str {
        "Fig. 8: training curves"
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let (mut validation, mut loss) = (Vec::new(), Vec::new());
        for model in context.models.clone() {
            let known = log_of(&model, "validation.csv").and_then(|path| curve(&path, "mse"));
            let known = known.filter(|points| points.len() > 1);
            let points = match known {
                Some(points) => points,
                None => of_stages(context, &model)?,
            };
            validation.push(Series::new(&model.name, Mark::Line, points));
            let points = log_of(&model, "log.csv").and_then(|path| curve(&path, "loss"));
            loss.push(Series::new(&model.name, Mark::Line, points.unwrap_or_default()));
        }
        let mut blocks = Vec::new();
        for (mut series, title, axis, caption, remedy) in [
            (
                validation,
                "Validation error",
                "mean MSE of validation rollouts [box²]",
                "Rollouts of all validation cases from their first frames; of weights that a training had \
                 on its way, their first second. In units of the box. Where a rollout of these ended early \
                 its last error stands for what was not predicted, which would have been worse.",
                "`surrogate train` validates where the data have `valid/`; weights that it had on its \
                 way, kept in `NAME.stages/` beside `NAME.safetensors`, are rolled out by the report.",
            ),
            (
                loss,
                "Loss",
                "loss",
                "Losses of networks with different noise cannot be compared; rollouts can.",
                "`surrogate train` writes `log.csv`; beside `NAME.safetensors` it is `NAME.log.csv`.",
            ),
        ] {
            // One point is no curve.
            series.retain(|series| series.points.len() > 1);
            if series.is_empty() {
                blocks.push(Block::missing(title, "no model came with it.", remedy));
                continue;
            }
            let chart = Chart { x: Axis::linear("step"), y: Axis::log(axis), series, floor: None };
            let title = format!("{title} over training steps");
            blocks.push(Block::Figure(Figure::new(title, chart.draw()?, caption)));
        }
        Ok(blocks)
    }
}

/// Time (s) that weights on their way predict.
const LOOK: f64 = 1.0;

/// Steps and mean validation error of the weights that a model had on its way, and of itself; nothing
/// if there are none, or no validation cases.
fn of_stages(context: &mut Context, model: &Model) -> miette::Result<Vec<(f64, f64)>> {
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
        let frames = (LOOK / simulator.training.frame_interval).round() as usize;
        let frames = Some(frames.max(simulator.first_frames() + 1));
        let name = format!("{}, step {steps}", model.name);
        stages.push((steps, Model { frames, ..Model::new(name, path) }));
    }
    stages.sort_by_key(|(steps, _)| *steps);
    stages.dedup_by_key(|(steps, _)| *steps);
    let models: Vec<Model> = stages.iter().map(|(_, stage)| stage.clone()).collect();
    let rollouts = roll_out(context, &models, &cases)?;
    let points = stages.iter().filter_map(|(steps, stage)| {
        let own: Vec<&Rollout> = rollouts.iter().filter(|r| r.model == stage.name).collect();
        Some((*steps as f64, error_of(&own)?))
    });
    Ok(points.collect())
}

/// Mean error of rollouts of as many frames. The last error of one that ended early stands for the rest;
/// none if one did not begin.
fn error_of(rollouts: &[&Rollout]) -> Option<f64> {
    let errors = |rollout: &Rollout| -> Vec<f64> {
        rollout.errors.errors.iter().map(|error| error.mse).collect()
    };
    let frames = rollouts.iter().map(|rollout| rollout.errors.errors.len()).max()?;
    let mean = |rollout: &&Rollout| {
        let known = errors(rollout);
        let rest = (frames - known.len()) as f64 * known.last()?;
        Some((known.iter().sum::<f64>() + rest) / frames as f64)
    };
    let means: Vec<f64> = rollouts.iter().map(mean).collect::<Option<_>>()?;
    Some(means.iter().sum::<f64>() / means.len() as f64)
}

/// The log of a training: in the folder of its own, or beside the weights under their name.
fn log_of(model: &Model, file: &str) -> Option<PathBuf> {
    if model.path.ends_with("best.safetensors") {
        return Some(model.path.parent()?.join(file));
    }
    Some(model.path.with_extension(file))
}

/// Steps and one column of a log; none if there is no such file or column, or it is empty.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_error_stands_for_what_was_not_predicted() {
        let [whole, short, none] =
            [&[1.0, 2.0, 6.0][..], &[1.0, 4.0], &[]].map(|mse| Rollout::of_errors("m", mse, None));
        assert_eq!(error_of(&[&whole, &short]), Some(3.0));
        assert_eq!(error_of(&[&whole, &none]), None);
        assert_eq!(error_of(&[]), None);
    }
}
