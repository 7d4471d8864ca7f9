//! Table 6: the ten networks.

use surrogate::network::{ModelConfig, PAPER_NETWORKS};
use surrogate::simulator::Simulator;

use super::cells::ratio;
use crate::context::Context;
use crate::literature::paper::NETWORKS;
use crate::models::{Model, ModelCost, belongs, trained_on};
use crate::render::block::Block;
use crate::render::section::Section;
use crate::render::table::Table;
use crate::text::number;

/// Parameters and training time of the ten networks.
pub struct Networks;

impl Section for Networks {
    fn title(&self) -> &'static str {
        "Table 6: networks"
    }

    fn lead(&self) -> &'static str {
        "Size and training time of the paper's ten networks, and all networks of this report."
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let (table, timed) = of_paper(&context.models)?;
        let mut blocks = vec![Block::Table(table)];
        if !context.models.is_empty() {
            blocks.push(Block::Table(of_report(&context.models)?));
        }
        if timed < PAPER_NETWORKS.len() {
            blocks.push(Block::missing(
                format!("Training time of {} of the ten networks", PAPER_NETWORKS.len() - timed),
                "there is no model of that name with its costs.",
                "`surrogate train configs/paper/NAME-data1.toml` trains one; `NAME.cost.toml` beside \
                 the weights has its costs.",
            ));
        }
        Ok(blocks)
    }
}

/// The paper's networks beside ours, and the number of ours with known training times.
fn of_paper(models: &[Model]) -> miette::Result<(Table, usize)> {
    let columns = [
        "network",
        "parameters: paper",
        "ours",
        "ratio",
        "ms per step: paper",
        "ours",
        "ratio",
        "trained on",
    ];
    let mut table = Table::new("Networks of the paper", columns)
        .note("Paper: two H800, batch 2 on each. Ours: batch and device as trained.");
    let mut timed = 0;
    for (name, paper) in PAPER_NETWORKS.iter().zip(NETWORKS) {
        let ours = ModelConfig::named(name).map(|config| config.parameter_count());
        let training = models
            .iter()
            .filter(|model| belongs(&model.name, name))
            .find_map(|model| Some((model, ModelCost::beside(&model.path).ok()?)));
        let (mut step, mut device) = (None, String::new());
        if let Some((model, cost)) = training {
            let steps = Simulator::load(&model.path)?.training.steps;
            (step, device) = (Some(1e3 * cost.training_seconds / steps as f64), cost.device);
            timed += 1;
        }
        table.row([
            (*name).to_owned(),
            paper.parameters.to_string(),
            ours.map_or(String::new(), |ours| ours.to_string()),
            ratio(Some(paper.parameters as f64), ours.map(|ours| ours as f64)),
            number(paper.step_milliseconds),
            step.map_or(String::new(), number),
            ratio(Some(paper.step_milliseconds), step),
            device,
        ]);
    }
    Ok((table, timed))
}

/// Architecture and training of all models.
fn of_report(models: &[Model]) -> miette::Result<Table> {
    let columns = [
        "model",
        "parameters",
        "width",
        "hidden layers",
        "message layers",
        "frames",
        "further inputs",
        "predicts",
        "steps",
        "trained on",
    ];
    let mut table = Table::new("Models of this report", columns).note(
        "From the files of the weights. A model named after a network of the paper has its \
         architecture except for further inputs of the nodes; its data and training are as listed.",
    );
    for model in models {
        let Simulator { config, training, .. } = Simulator::load(&model.path)?;
        let inputs: Vec<String> = config
            .node_features
            .iter()
            .map(|feature| format!("{feature:?}").to_lowercase())
            .collect();
        let predicts =
            if training.without_gravity { "accelerations less gravity" } else { "accelerations" };
        table.row([
            model.name.clone(),
            config.parameter_count().to_string(),
            config.width.to_string(),
            config.hidden_layers.to_string(),
            config.message_layers.to_string(),
            config.frames.to_string(),
            inputs.join(", "),
            predicts.to_owned(),
            training.steps.to_string(),
            trained_on(&training),
        ]);
    }
    Ok(table)
}
