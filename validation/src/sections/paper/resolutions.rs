//! Fig. 15 and 16: five resolutions in time.

use std::path::PathBuf;

use dempm::trajectory::Trajectory;
use plot::{Axis, Chart, Mark, Series};

use super::accuracy::ranking;
use super::networks::belongs;
use crate::block::{Block, Figure, Table};
use crate::context::{Context, Model};
use crate::rollouts::{Rollout, animation, chart, failures, roll_out, snapshots, table};
use crate::section::Section;
use crate::table::number;

/// Cells crossed per frame, and rollouts of networks trained on coarser frames.
pub struct Resolutions;

/// Frames of the data sets, in frames of the first.
const STRIDES: [usize; 5] = [1, 2, 3, 6, 10];

impl Section for Resolutions {
    fn title(&self) -> &'static str {
        "Fig. 15 and 16: five resolutions"
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let mut blocks = Vec::new();
        let training = context.trajectories("train");
        if training.is_empty() {
            blocks.push(Block::missing(
                "Cells crossed per frame",
                "there are no trajectories in `train/` of the data.",
                "`dempm dataset paper -o DATA` makes them; `--data DATA` takes them.",
            ));
        } else {
            blocks.extend(crossings(&training)?);
        }
        let cases = context.cases("valid");
        let of_data = |set: usize| {
            let models = context.models.iter();
            models
                .filter(move |m| {
                    belongs(&m.name, "baseline") && m.name.ends_with(&format!("-data{set}"))
                })
                .cloned()
                .collect::<Vec<Model>>()
        };
        let models: Vec<Model> = (1..=5).flat_map(of_data).collect();
        if models.is_empty() || cases.is_empty() {
            blocks.push(Block::missing(
                "Errors over resolutions",
                "that takes the validation trajectories and models named `baseline-data1` to \
                 `baseline-data5`.",
                "`surrogate train configs/paper/baseline-data2.toml` trains one of them.",
            ));
            return Ok(blocks);
        }
        let rollouts = roll_out(context, &models, &cases)?;
        blocks.extend(ranking("Resolutions", &models, &rollouts)?);
        for (case, _) in &cases {
            let of_case: Vec<&Rollout> = rollouts.iter().filter(|r| r.case == *case).collect();
            blocks.push(chart(case, &of_case, None)?);
        }
        blocks.push(Block::Table(table(&rollouts)));
        // Why others ended early is in the table.
        blocks.extend(failures(rollouts.iter().filter(|rollout| rollout.is_refused())));
        // One case of each data set.
        for model in &models {
            let first = rollouts.iter().find(|rollout| rollout.model == model.name);
            if let Some(rollout) = first {
                blocks.extend(snapshots(rollout)?);
                blocks.extend(animation(rollout)?);
            }
        }
        Ok(blocks)
    }
}

/// Histogram of the cells that points cross from one frame to the next.
fn crossings(paths: &[PathBuf]) -> miette::Result<Vec<Block>> {
    let mut counts = STRIDES.map(|_| Vec::<usize>::new());
    for path in paths {
        let trajectory = Trajectory::open(path)?;
        let (cell, frames) = (trajectory.header().grid_cell, trajectory.frames());
        let position = trajectory.positions(0..frames)?;
        for (count, stride) in counts.iter_mut().zip(STRIDES) {
            for frame in (stride..frames).step_by(stride) {
                for point in 0..trajectory.points().mass.len() {
                    let at = |frame: usize| [0, 1].map(|k| position[[frame, point, k]]);
                    let crossed = crossed(at(frame - stride), at(frame), cell);
                    if count.len() <= crossed {
                        count.resize(crossed + 1, 0);
                    }
                    count[crossed] += 1;
                }
            }
        }
    }
    let most = counts.iter().map(Vec::len).max().unwrap_or(0);
    let titles: Vec<String> = (0..most).map(|cells| cells.to_string()).collect();
    let columns = std::iter::once("data set").chain(titles.iter().map(String::as_str));
    let mut table = Table::new("Cells crossed per frame", columns).note(format!(
        "Percentage of points and frames of {} training runs. A cell crossed along x and one along \
         y count as two.",
        paths.len()
    ));
    let mut series = Vec::new();
    for (set, count) in counts.iter().enumerate() {
        let total = count.iter().sum::<usize>().max(1) as f64;
        let shares: Vec<f64> = count.iter().map(|n| 100.0 * *n as f64 / total).collect();
        let name = format!("data set {}", set + 1);
        table.row(std::iter::once((set + 1).to_string()).chain(shares.iter().map(|s| number(*s))));
        let points = shares.iter().enumerate().map(|(cells, share)| (cells as f64, *share));
        series.push(Series::new(name, Mark::Line, points.collect()));
    }
    let chart = Chart {
        x: Axis::linear("cells crossed per frame"),
        y: Axis::log("share of points [%]"),
        series,
        floor: None,
    };
    let caption = "The coarser the frames, the farther a network has to predict in one step.";
    Ok(vec![
        Block::Figure(Figure::new(
            "Histogram of cells crossed",
            chart.svg().map(crate::figure::Picture::Svg)?,
            caption,
        )),
        Block::Table(table),
    ])
}

/// Faces of grid cells between two places, along both axes.
fn crossed(from: [f64; 2], to: [f64; 2], cell: f64) -> usize {
    let along = |k: usize| ((to[k] / cell).floor() - (from[k] / cell).floor()).abs() as usize;
    along(0) + along(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_are_counted_along_both_axes() {
        assert_eq!(crossed([0.1, 0.1], [0.2, 0.1], 0.25), 0);
        assert_eq!(crossed([0.1, 0.6], [0.6, 0.4], 0.25), 3);
    }
}
