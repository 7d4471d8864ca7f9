//! Fig. 8: training curves.

use std::path::{Path, PathBuf};

use surrogate::simulator::Simulator;

use super::accuracy::mean_error;
use crate::block::{Block, Figure};
use crate::chart::{Axis, Chart, Mark, Series};
use crate::context::{Context, Model, files_in};
use crate::rollouts::roll_out;
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
                 on its way, their first second. In units of the box.",
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

/// Time (s) that weights on their way predict: a young network presses points together until each has
/// hundreds of neighbours, which takes minutes and says no more.
const LOOK: f64 = 1.0;

/// Steps and mean validation error of the weights that a model had on its way, and of itself; nothing
/// if there are none, or no validation cases. Where a rollout ended early there is no point.
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
    let error = |(steps, stage): &(u64, Model)| (*steps as f64, mean_error(&rollouts, &stage.name));
    Ok(stages.iter().map(error).filter(|(_, error)| error.is_finite()).collect())
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
