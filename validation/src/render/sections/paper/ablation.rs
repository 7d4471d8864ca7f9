//! Fig. 11 to 14: the ten networks on the validation cases.

use surrogate::network::PAPER_NETWORKS;

use super::absent::absent;
use super::ranking::ranking_blocks;
use crate::context::Context;
use crate::models::{Model, belongs, is_on_finest_data};
use crate::render::block::Block;
use crate::render::rollouts::{chart, failures, table};
use crate::render::section::Section;
use crate::studies::ranking::Ranking;
use crate::studies::rollouts::{Rollout, roll_out};

/// The ten networks on the validation cases.
pub struct Ablation;

impl Section for Ablation {
    fn title(&self) -> &'static str {
        "Fig. 11 to 14: ablation of ten networks"
    }

    fn lead(&self) -> &'static str {
        "The paper's ten networks, which differ in one part each, after equal training."
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let cases = context.cases("valid");
        // All on the finest data; trainings for this comparison are named `-data1`.
        let trained = |name: &&str| {
            let of_name = context.models.iter().filter(|model| belongs(&model.name, name));
            let finest = of_name.filter(|model| is_on_finest_data(model));
            finest.min_by_key(|model| !model.name.ends_with("-data1")).cloned()
        };
        let models: Vec<Model> = PAPER_NETWORKS.iter().filter_map(trained).collect();
        let mut blocks = absent(&cases, &models, "valid");
        if !blocks.is_empty() {
            return Ok(blocks);
        }
        let rollouts = roll_out(context, &models, &cases)?;
        blocks.extend(ranking_blocks("Networks", &Ranking::of(&models, &rollouts)?));
        for (case, _) in &cases {
            let of_case: Vec<&Rollout> = rollouts.iter().filter(|r| r.case == *case).collect();
            blocks.push(chart(case, &of_case, None)?);
        }
        blocks.push(Block::Table(table(&rollouts)));
        // The table says why others ended early.
        blocks.extend(failures(rollouts.iter().filter(|rollout| rollout.is_refused())));
        let lacking: Vec<&str> = PAPER_NETWORKS
            .into_iter()
            .filter(|name| !models.iter().any(|model| belongs(&model.name, name)))
            .collect();
        if !lacking.is_empty() {
            blocks.push(Block::missing(
                lacking.join(", "),
                "there is no model of that name.",
                "`surrogate train configs/paper/NAME-data1.toml` trains one.",
            ));
        }
        Ok(blocks)
    }
}
