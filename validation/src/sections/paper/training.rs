//! Fig. 8: training curves.

use std::path::{Path, PathBuf};

use plot::{Axis, Chart, Mark, Series};
use surrogate::simulator::Simulator;

use super::networks::{of_paper, on_finest_data};
use crate::block::{Block, Figure};
use crate::compare::errors_if_held;
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
        let models = context.models.clone();
        let (mut validation, mut loss) = (Vec::new(), Vec::new());
        for model in &models {
            let known = log_of(model, "validation.csv").and_then(|path| curve(&path, "mse"));
            let known = known.filter(|points| points.len() > 1);
            let points = match known {
                Some(points) => points,
                None => of_stages(context, model)?,
            };
            validation.push(Series::new(&model.name, Mark::Line, points));
            let points = log_of(model, "log.csv").and_then(|path| curve(&path, "loss"));
            loss.push(Series::new(&model.name, Mark::Line, points.unwrap_or_default()));
        }
        let mut blocks = Vec::new();
        for (series, title, axis, caption, remedy) in [
            (
                validation,
                "Validation error",
                "mean MSE of validation rollouts [box²]",
                "Rollouts of all validation cases from their first frames; of weights that a training had \
                 on its way, their first 1.5 s. In units of the box. What one of these that ended early did \
                 not predict counts as if it had stayed where it was.",
                "`surrogate train` validates where the data have `valid/`; weights that it had on its \
                 way, kept in `NAME.stages/` beside `NAME.safetensors`, are rolled out by the report.",
            ),
            (
                loss,
                "Loss",
                "loss",
                "Losses of networks with different noise cannot be compared; rollouts can. One that begins to \
                 predict the frames of its windows by itself (pushforward) has more to learn from then on.",
                "`surrogate train` writes `log.csv`; beside `NAME.safetensors` it is `NAME.log.csv`.",
            ),
        ] {
            // One point is no curve.
            if series.iter().all(|series| series.points.len() < 2) {
                blocks.push(Block::missing(title, "no model came with it.", remedy));
            }
            for (group, belongs) in GROUPS {
                let curves = models.iter().zip(&series);
                let curves = curves.filter(|(model, s)| belongs(model) && s.points.len() > 1);
                let series: Vec<Series> = curves.map(|(_, series)| series.clone()).collect();
                if series.is_empty() {
                    continue;
                }
                let chart =
                    Chart { x: Axis::linear("step"), y: Axis::log(axis), series, floor: None };
                let title = format!("{title} over training steps: {group}");
                blocks.push(Block::Figure(Figure::new(
                    title,
                    chart.svg().map(crate::figure::Picture::Svg)?,
                    caption,
                )));
            }
        }
        Ok(blocks)
    }
}

/// What models a chart shows, so that it can be read.
type Group = (&'static str, fn(&Model) -> bool);
const GROUPS: [Group; 2] = [
    ("the paper's networks", |model| of_paper(model) && on_finest_data(model)),
    ("other data and models", |model| !of_paper(model) || !on_finest_data(model)),
];

/// Time (s) until which weights on their way predict.
const LOOK: f64 = 1.5;

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
        let frames = (LOOK / simulator.training.frame_interval).round() as usize + 1;
        let frames = Some(frames.max(simulator.first_frames() + 1));
        let name = format!("{}, step {steps}", model.name);
        stages.push((steps, Model { frames, ..Model::new(name, path) }));
    }
    stages.sort_by_key(|(steps, _)| *steps);
    stages.dedup_by_key(|(steps, _)| *steps);
    let models: Vec<Model> = stages.iter().map(|(_, stage)| stage.clone()).collect();
    let rollouts = roll_out(context, &models, &cases)?;
    let mut points = Vec::new();
    for (steps, stage) in &stages {
        let own = rollouts.iter().filter(|rollout| rollout.model == stage.name);
        let errors = own.map(error_of).collect::<miette::Result<Option<Vec<f64>>>>()?;
        points.extend(errors.and_then(|errors| mean(&errors)).map(|mean| (*steps as f64, mean)));
    }
    Ok(points)
}

/// Mean error of a rollout until [`LOOK`]; one that ended early stays where it was. None if it did not begin.
fn error_of(rollout: &Rollout) -> miette::Result<Option<f64>> {
    if rollout.is_refused() {
        return Ok(None);
    }
    let mut errors: Vec<f64> = rollout.errors.errors.iter().map(|error| error.mse).collect();
    errors.extend(errors_if_held(&rollout.output, &rollout.truth, LOOK)?);
    Ok(mean(&errors))
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
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
