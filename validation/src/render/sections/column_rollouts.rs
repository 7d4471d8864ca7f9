//! The learned simulators on the small column, frame by frame.

use super::no_model::no_model;
use crate::context::Context;
use crate::difference::kept_difference;
use crate::models::baseline_and_others;
use crate::render::block::Block;
use crate::render::figure::Figure;
use crate::render::rollouts::{animation, animation_of_runs, chart, failures, snapshots, table};
use crate::render::section::Section;
use crate::studies::rollouts::roll_out;
use crate::studies::solver_column;

/// Rollouts of the small column.
pub struct ColumnRollouts;

impl Section for ColumnRollouts {
    fn title(&self) -> &'static str {
        "Rollouts of the column of 1 m"
    }

    fn lead(&self) -> &'static str {
        "The collapse of a column of 1 m as each network predicts it, over the solver's."
    }

    fn estimate(&self, context: &Context) -> f64 {
        solver_column::estimate(context)
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let [truth, other] = solver_column::measure(context)?;
        if context.models.is_empty() {
            let title = "Two runs of the solver, animated";
            let caption = "Two runs of the solver with different random packings. Grey: the first. Coloured: \
                           the second, from blue (close to the first) over yellow to red (far from it).";
            let animation = animation_of_runs(title, caption, &other.output, &truth.output)?;
            return Ok(vec![Block::Figure(animation.on_cover()), no_model()]);
        }
        let models = baseline_and_others(&context.models);
        let rollouts = roll_out(context, &models, &[("column".to_owned(), truth.output.clone())])?;
        let floor = kept_difference(&other, &truth.output, &truth.id)?;
        let all: Vec<_> = rollouts.iter().collect();
        let mut blocks = vec![
            Block::text(
                "Every network starts from the first frames of the solver's column (`scenes/column-paper.toml`, \
                 200 discs in a packing) and predicts the rest. Errors are against the solver, not against \
                 the discs. No deterministic network can be better than half of the difference between \
                 two seeds.",
            ),
            chart("Error over time", &all, Some(&floor))?,
            Block::Table(table(&rollouts)),
        ];
        blocks.extend(failures(&rollouts));
        let mut animated = false;
        for rollout in &rollouts {
            blocks.extend(snapshots(rollout)?);
            let animation = animation(rollout)?;
            let shown = animation.map(|figure| if animated { figure } else { figure.on_cover() });
            animated |= shown.is_some();
            blocks.extend(shown.map(|figure: Figure| Block::Figure(figure)));
        }
        Ok(blocks)
    }
}
