//! The learned simulators on the column of 1 m, frame by frame.

use super::no_model::no_model;
use crate::context::Context;
use crate::difference::kept_difference;
use crate::models::{Model, baseline_and_others};
use crate::render::block::Block;
use crate::render::rollouts::{animation, animation_of_runs, chart, failures, snapshots, table};
use crate::render::section::Section;
use crate::studies::rollouts::roll_out;
use crate::studies::solver_column::{DISCS, PACKINGS, estimate, measure};

/// Rollouts of the small column.
pub struct ColumnRollouts;

impl Section for ColumnRollouts {
    fn title(&self) -> &'static str {
        "Rollouts of the column of 1 m"
    }

    fn lead(&self) -> &'static str {
        "The collapse of a column of 1 m as each network predicts it, over a run of the model that it learnt from."
    }

    fn estimate(&self, context: &Context) -> f64 {
        let discs = context.models.iter().any(|model| model.of_discs);
        let discs = if discs { estimate(context, DISCS) } else { 0.0 };
        estimate(context, PACKINGS) + discs
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        if context.models.is_empty() {
            let [truth, other] = measure(context, PACKINGS)?;
            let title = "Two runs of the solver, animated";
            let caption = "Two runs of the solver with different random packings. Grey: the first. Coloured: \
                           the second, from blue (close to the first) over yellow to red (far from it).";
            let animation = animation_of_runs(title, caption, &other.output, &truth.output)?;
            return Ok(vec![Block::Figure(animation.on_cover()), no_model()]);
        }
        let (of_discs, of_packings): (Vec<Model>, _) =
            baseline_and_others(&context.models).into_iter().partition(|model| model.of_discs);
        let (mut blocks, mut all) = (Vec::new(), Vec::new());
        for (models, teacher) in [(of_packings, OF_PACKINGS), (of_discs, OF_DISCS)] {
            if models.is_empty() {
                continue;
            }
            let [truth, other] = measure(context, teacher.column)?;
            let floor = kept_difference(&other, &truth.output, &truth.id)?;
            let cases = [(teacher.case.to_owned(), truth.output)];
            let rollouts = roll_out(context, &models, &cases)?;
            blocks.push(Block::text(teacher.text));
            let title = format!("Error over time, {}", teacher.case);
            blocks.push(chart(&title, &rollouts.iter().collect::<Vec<_>>(), Some(&floor))?);
            all.extend(rollouts);
        }
        blocks.push(Block::Table(table(&all)));
        blocks.extend(failures(&all));
        let mut animated = false;
        for rollout in &all {
            blocks.extend(snapshots(rollout)?);
            let animation = animation(rollout)?;
            let shown = animation.map(|figure| if animated { figure } else { figure.on_cover() });
            animated |= shown.is_some();
            blocks.extend(shown.map(Block::Figure));
        }
        Ok(blocks)
    }
}

/// A model that networks learnt from, on the column.
struct Teacher {
    /// The scene.
    column: &'static str,
    /// The name of the case.
    case: &'static str,
    /// How its networks are measured.
    text: &'static str,
}

const OF_PACKINGS: Teacher = Teacher {
    column: PACKINGS,
    case: "column of packings",
    text: "Networks that learnt from packings start from the first frames of a column of packings \
           (`scenes/column-paper.toml`, 200 discs in a packing) and predict the rest. Errors are against that \
           column, not against the discs. No deterministic network can be better than half of the difference \
           between two seeds.",
};

const OF_DISCS: Teacher = Teacher {
    column: DISCS,
    case: "column of discs",
    text: "Networks that learnt from discs start from the first frames of a column of discs (`scenes/discs.toml`). \
           Errors are against that run.",
};
