//! Fig. 15 and 16: five resolutions in time.

use plot::{Axis, Chart, Mark, Series};

use super::absent::MAKE_DATA;
use super::ranking::ranking_blocks;
use crate::context::Context;
use crate::models::{Model, belongs};
use crate::render::block::Block;
use crate::render::figure::{Figure, Picture};
use crate::render::rollouts::{animation, chart, failures, snapshots, table};
use crate::render::section::Section;
use crate::render::table::Table;
use crate::studies::cell_crossings::histograms;
use crate::studies::ranking::Ranking;
use crate::studies::rollouts::{Rollout, roll_out};
use crate::text::number;

/// Cells crossed per frame, and rollouts of networks trained on coarser frames.
pub struct Resolutions;

impl Section for Resolutions {
    fn title(&self) -> &'static str {
        "Fig. 15 and 16: five resolutions"
    }

    fn lead(&self) -> &'static str {
        "The Baseline after training on frames that are ever further apart."
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let mut blocks = Vec::new();
        let training = context.trajectories("train");
        if training.is_empty() {
            blocks.push(Block::missing(
                "Cells crossed per frame",
                "there are no trajectories in `train/` of the data.",
                MAKE_DATA,
            ));
        } else {
            blocks.extend(crossings(&histograms(&training)?, training.len())?);
        }
        let cases = context.cases("valid");
        let models: Vec<Model> = (1..=5).flat_map(|set| of_data(&context.models, set)).collect();
        if models.is_empty() || cases.is_empty() {
            blocks.push(Block::missing(
                "Errors over resolutions",
                "it needs the validation trajectories and models named `baseline-data1` to \
                 `baseline-data5`.",
                "`surrogate train configs/paper/baseline-data2.toml` trains one of them.",
            ));
            return Ok(blocks);
        }
        let rollouts = roll_out(context, &models, &cases)?;
        blocks.extend(ranking_blocks("Resolutions", &Ranking::of(&models, &rollouts)?));
        for (case, _) in &cases {
            let of_case: Vec<&Rollout> = rollouts.iter().filter(|r| r.case == *case).collect();
            blocks.push(chart(case, &of_case, None)?);
        }
        blocks.push(Block::Table(table(&rollouts)));
        // The table says why others ended early.
        blocks.extend(failures(rollouts.iter().filter(|rollout| rollout.is_refused())));
        // One case of each data set.
        for model in &models {
            let first = rollouts.iter().find(|rollout| rollout.model == model.name);
            if let Some(rollout) = first {
                blocks.extend(snapshots(rollout)?);
                blocks.extend(animation(rollout)?.map(Block::Figure));
            }
        }
        Ok(blocks)
    }
}

/// Trainings of the Baseline on a data set.
fn of_data(models: &[Model], set: usize) -> Vec<Model> {
    let suffix = format!("-data{set}");
    let of_set = |m: &&Model| belongs(&m.name, "baseline") && m.name.ends_with(&suffix);
    models.iter().filter(of_set).cloned().collect()
}

/// Histograms of the cells that points cross from one frame to the next.
fn crossings(histograms: &[Vec<usize>], runs: usize) -> miette::Result<[Block; 2]> {
    let most = histograms.iter().map(Vec::len).max().unwrap_or(0);
    let titles: Vec<String> = (0..most).map(|cells| cells.to_string()).collect();
    let columns = std::iter::once("data set").chain(titles.iter().map(String::as_str));
    let mut table = Table::new("Cells crossed per frame", columns).note(format!(
        "Percentage of points and frames of {runs} training runs. A cell crossed along x and one along \
         y count as two."
    ));
    let mut series = Vec::new();
    for (set, counts) in histograms.iter().enumerate() {
        let total = counts.iter().sum::<usize>().max(1) as f64;
        let shares: Vec<f64> = counts.iter().map(|n| 100.0 * *n as f64 / total).collect();
        let name = format!("data set {}", set + 1);
        table.row(std::iter::once((set + 1).to_string()).chain(shares.iter().map(|s| number(*s))));
        let points = shares.iter().enumerate().map(|(cells, share)| (cells as f64, *share));
        series.push(Series::new(name, Mark::Line, points.collect()));
    }
    let svg = Chart {
        x: Axis::linear("cells crossed per frame"),
        y: Axis::log("share of points [%]"),
        series,
        floor: None,
    }
    .svg()?;
    let caption = "The coarser the frames, the farther a network has to predict in one step.";
    Ok([
        Block::Figure(Figure::new("Histogram of cells crossed", Picture::Svg(svg), caption)),
        Block::Table(table),
    ])
}
