//! Fig. 8: training curves.

use std::path::{Path, PathBuf};

use crate::block::{Block, Figure};
use crate::chart::{Axis, Chart, Mark, Series};
use crate::context::{Context, Model};
use crate::section::Section;

/// Loss and validation error over the steps of trainings.
pub struct Training;

impl Section for Training {
    fn title(&self) -> &'static str {
        "Fig. 8: training curves"
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let mut blocks = Vec::new();
        for (file, column, title) in [
            ("validation.csv", "mse", "MSE of validation rollouts [box²]"),
            ("log.csv", "loss", "loss"),
        ] {
            let curve = |model: &Model| {
                let points = curve(&log_of(model, file)?, column)?;
                Some(Series::new(&model.name, Mark::Line, points))
            };
            let series: Vec<Series> = context.models.iter().filter_map(curve).collect();
            if series.is_empty() {
                continue;
            }
            let chart = Chart { x: Axis::linear("step"), y: Axis::log(title), series, floor: None };
            blocks.push(Block::Figure(Figure::new(
                format!("Training: {column}"),
                chart.draw()?,
                "Losses of networks with different noise cannot be compared; rollouts can.",
            )));
        }
        if blocks.is_empty() {
            blocks.push(Block::missing(
                "Training curves",
                "no model came with `log.csv` or `validation.csv` of its training.",
                "`--models` takes the folder in which `surrogate train -o` made its own; beside \
                 `NAME.safetensors` they are `NAME.log.csv` and `NAME.validation.csv`.",
            ));
        }
        Ok(blocks)
    }
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
