//! Fig. 9, 10 and 17 to 22: rollouts of the validation and test cases.

use super::absent::absent;
use crate::context::Context;
use crate::models::{Model, baseline, of_packings};
use crate::render::block::Block;
use crate::render::rollouts::{animation, chart, failures, snapshots, table};
use crate::render::section::Section;
use crate::studies::rollouts::{Rollout, mean_error, roll_out};

/// The Baseline and all networks that are not the paper's on some cases.
pub struct Cases {
    /// The heading.
    pub title: &'static str,
    /// The lead.
    pub lead: &'static str,
    /// Folder of the data.
    pub set: &'static str,
    /// Which of its cases.
    pub only: fn(&str) -> bool,
    /// The case whose animation the first screen shows; empty for none.
    pub cover: &'static str,
}

impl Section for Cases {
    fn title(&self) -> &'static str {
        self.title
    }

    fn lead(&self) -> &'static str {
        self.lead
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let mut cases = context.cases(self.set);
        cases.retain(|(name, _)| (self.only)(name));
        let models = of_packings(&context.models);
        let mut blocks = absent(&cases, &models, self.set);
        if !blocks.is_empty() {
            return Ok(blocks);
        }
        if baseline(&models).is_none() {
            blocks.push(Block::text("There is no model named `baseline`."));
        }
        // The first of them also with mirror images averaged, which the paper did not try.
        let mirrored = models.first().map(Model::mirrored);
        let ways: Vec<Model> = models.iter().cloned().chain(mirrored).collect();
        let rollouts = roll_out(context, &ways, &cases)?;
        blocks.push(Block::Table(table(&rollouts)));
        blocks.extend(failures(&rollouts));
        for (place, model) in drawn(&models, &rollouts).into_iter().enumerate() {
            let of_model: Vec<&Rollout> =
                rollouts.iter().filter(|rollout| rollout.model == model.name).collect();
            let title = format!("Error over time, {}", model.name);
            blocks.push(chart(&title, &of_model, None)?);
            for rollout in of_model {
                blocks.extend(snapshots(rollout)?);
                // Animations of one model are enough for a page.
                if place == 0 {
                    let animation = animation(rollout)?.map(|figure| {
                        if rollout.case == self.cover { figure.on_cover() } else { figure }
                    });
                    blocks.extend(animation.map(Block::Figure));
                }
            }
        }
        Ok(blocks)
    }
}

/// The first model, and the most accurate one if that is another.
fn drawn<'m>(models: &'m [Model], rollouts: &[Rollout]) -> Vec<&'m Model> {
    let error = |model: &Model| mean_error(rollouts, &model.name);
    let best = models.iter().min_by(|a, b| error(a).total_cmp(&error(b)));
    let mut drawn: Vec<&Model> = models.first().into_iter().chain(best).collect();
    drawn.dedup_by_key(|model| &model.name);
    drawn
}
