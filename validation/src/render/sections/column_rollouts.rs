//! The learned simulators on the small column, frame by frame.

use crate::block::Block;
use crate::compare::kept_difference;
use crate::context::Context;
use crate::rollouts::{animation, chart, failures, roll_out, snapshots, table};
use crate::section::Section;
use crate::sections::paper::networks::baseline_and_others;
use crate::sections::speed_accuracy::no_model;
use crate::sweep::Case;

/// Rollouts of the small column.
pub struct Column;

impl Section for Column {
    fn title(&self) -> &'static str {
        "Rollouts of the column of 1 m"
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        if context.models.is_empty() {
            return Ok(vec![no_model()]);
        }
        // The first case of every suite.
        let case = Case::of(context.suite).remove(0);
        let [truth, other] = case.run_references(context)?;
        let models = baseline_and_others(&context.models);
        let rollouts = roll_out(context, &models, &[("column".to_owned(), truth.output.clone())])?;
        let floor = kept_difference(&other, &truth.output, &truth.id)?;
        let all: Vec<_> = rollouts.iter().collect();
        let mut blocks = vec![
            Block::text(format!(
                "Every model starts from the first frames of the direct solver's column ({}) and \
                     predicts the rest. No deterministic model can be better than half of the \
                     difference between two seeds.",
                case.reference_words
            )),
            chart("Error over time", &all, Some(&floor))?,
            Block::Table(table(&rollouts)),
        ];
        blocks.extend(failures(&rollouts));
        for rollout in &rollouts {
            blocks.extend(snapshots(rollout)?);
            blocks.extend(animation(rollout)?);
        }
        Ok(blocks)
    }
}
