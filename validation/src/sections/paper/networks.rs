//! Table 6: the ten networks.

use surrogate::diagnostics::TrainingRange;
use surrogate::network::{ModelConfig, PAPER_NETWORKS};
use surrogate::simulator::{Simulator, Training};

use super::ratio;
use super::times::baseline;
use crate::block::{Block, Table};
use crate::context::{Context, Model};
use crate::model_cost::ModelCost;
use crate::section::Section;
use crate::table::number;

/// Parameters and training time of the ten networks.
pub struct Networks;

/// Parameters, and training time per step on two H800 with batches of two each, ms; in the order
/// of [`PAPER_NETWORKS`].
const TABLE_6: [(usize, f64); 10] = [
    (1_425_282, 70.5),
    (1_062_018, 64.7),
    (1_276_546, 66.1),
    (1_127_810, 61.9),
    (830_594, 54.6),
    (1_127_810, 51.5),
    (599_170, 37.2),
    (979_074, 46.3),
    (830_594, 47.6),
    (748_802, 85.3),
];

impl Section for Networks {
    fn title(&self) -> &'static str {
        "Table 6: networks"
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
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
        for (name, (parameters, step)) in PAPER_NETWORKS.iter().zip(TABLE_6) {
            let ours = ModelConfig::named(name).map(|config| config.parameter_count());
            let training = context
                .models
                .iter()
                .filter(|model| belongs(&model.name, name))
                .find_map(|model| Some((model, ModelCost::beside(&model.path).ok()?)));
            let mut measured = (None, String::new());
            if let Some((model, cost)) = training {
                let steps = Simulator::load(&model.path)?.training.steps;
                measured = (Some(1e3 * cost.training_seconds / steps as f64), cost.device);
                timed += 1;
            }
            table.row([
                (*name).to_owned(),
                parameters.to_string(),
                ours.map_or(String::new(), |ours| ours.to_string()),
                ratio(Some(parameters as f64), ours.map(|ours| ours as f64)),
                number(step),
                measured.0.map_or(String::new(), number),
                ratio(Some(step), measured.0),
                measured.1,
            ]);
        }
        let mut blocks = vec![Block::Table(table)];
        if !context.models.is_empty() {
            blocks.push(Block::Table(models(&context.models)?));
        }
        if timed < PAPER_NETWORKS.len() {
            blocks.push(Block::missing(
                format!("Training time of {} of the ten networks", PAPER_NETWORKS.len() - timed),
                "there is no model of that name with its costs among the models.",
                "`surrogate train configs/paper/NAME-data1.toml` trains one; `NAME.cost.toml` \
                 beside the weights says what it took.",
            ));
        }
        Ok(blocks)
    }
}

/// What the models of this report are.
fn models(models: &[Model]) -> miette::Result<Table> {
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
        "As their files of weights say. A model with the name of a network of the paper has its \
         architecture, but for further inputs of nodes; its data and its training are those that stand \
         here.",
    );
    for model in models {
        let Simulator { config, training, .. } = Simulator::load(&model.path)?;
        let inputs: Vec<String> = config
            .node_features
            .iter()
            .map(|feature| format!("{feature:?}").to_lowercase())
            .collect();
        table.row([
            model.name.clone(),
            config.parameter_count().to_string(),
            config.width.to_string(),
            config.hidden_layers.to_string(),
            config.message_layers.to_string(),
            config.frames.to_string(),
            inputs.join(", "),
            if training.without_gravity { "accelerations less gravity" } else { "accelerations" }
                .to_owned(),
            training.steps.to_string(),
            trained_on(&training),
        ]);
    }
    Ok(table)
}

/// What the training data of a model held.
pub fn trained_on(training: &Training) -> String {
    let Some(TrainingRange { least, most }) = &training.range else {
        return "what is not known of this model".into();
    };
    format!(
        "{} to {} points, {} to {} m high, {} to {} m wide, up to {} m/s on average",
        number(least.points),
        number(most.points),
        number(least.height),
        number(most.height),
        number(least.width),
        number(most.width),
        number(most.speed)
    )
}

/// Whether a model is a training of a network: it has the network's name, which `tgnns-` may precede
/// and `-dataN` may follow.
pub fn belongs(model: &str, network: &str) -> bool {
    let rest = model.strip_prefix("tgnns-").unwrap_or(model).strip_prefix(network);
    rest.is_some_and(|rest| rest.is_empty() || rest.starts_with("-data"))
}

/// The paper's Baseline, and all models that are none of its networks: the ablation's differ too
/// little to be looked at one by one.
pub fn baseline_and_others(models: &[Model]) -> Vec<Model> {
    let others = models.iter().filter(|model| !of_paper(model)).cloned();
    baseline(models).into_iter().chain(others).collect()
}

/// All other trainings of the paper's networks.
pub fn ablation(models: &[Model]) -> Vec<Model> {
    let first = baseline(models).map(|model| model.name);
    let others = models.iter().filter(|m| of_paper(m) && Some(&m.name) != first.as_ref());
    others.cloned().collect()
}

/// Whether a model is a training of one of the paper's networks.
pub fn of_paper(model: &Model) -> bool {
    PAPER_NETWORKS.iter().any(|name| belongs(&model.name, name))
}

/// Whether a model's name says nothing of data with coarser frames than the paper's data set 1.
pub fn on_finest_data(model: &Model) -> bool {
    model.name.ends_with("-data1") || !model.name.contains("-data")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_are_known_by_the_names_of_their_networks() {
        assert!(belongs("frame4", "frame4") && belongs("frame4-data1", "frame4"));
        assert!(belongs("tgnns-baseline", "baseline") && !belongs("tgnns-tiny", "baseline"));
        assert!(!belongs("frame4-hidden1-data1", "frame4") && !belongs("tiny", "frame4"));
    }

    #[test]
    fn parameters_are_those_of_the_paper() {
        for (name, (parameters, _)) in PAPER_NETWORKS.iter().zip(TABLE_6) {
            assert_eq!(ModelConfig::named(name).unwrap().parameter_count(), parameters, "{name}");
        }
    }
}
