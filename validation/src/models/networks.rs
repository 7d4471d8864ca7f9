//! Which of the paper's networks a model is, by its name.

use surrogate::diagnostics::TrainingRange;
use surrogate::network::PAPER_NETWORKS;
use surrogate::simulator::Training;

use super::model::Model;
use crate::text::number;

/// Whether a model is a training of a network: it has the network's name, with an optional prefix
/// `tgnns-` and an optional suffix `-dataN`.
pub fn belongs(model: &str, network: &str) -> bool {
    let rest = model.strip_prefix("tgnns-").unwrap_or(model).strip_prefix(network);
    rest.is_some_and(|rest| rest.is_empty() || rest.starts_with("-data"))
}

/// The paper's Baseline: preferably the model whose name has no data set.
pub fn baseline(models: &[Model]) -> Option<Model> {
    let all = models.iter().filter(|model| belongs(&model.name, "baseline"));
    all.min_by_key(|model| model.name.contains("-data")).cloned()
}

/// The paper's Baseline, and all models that are none of the paper's networks. The networks of the
/// ablation differ too little to be shown one by one.
pub fn baseline_and_others(models: &[Model]) -> Vec<Model> {
    let others = models.iter().filter(|model| !is_of_paper(model)).cloned();
    baseline(models).into_iter().chain(others).collect()
}

/// Of [`baseline_and_others`] those that learnt from packings, as the paper's.
pub fn of_packings(models: &[Model]) -> Vec<Model> {
    baseline_and_others(models).into_iter().filter(|model| !model.of_discs).collect()
}

/// All trainings of the paper's networks but the [`baseline`].
pub fn ablation(models: &[Model]) -> Vec<Model> {
    let first = baseline(models).map(|model| model.name);
    let others = models.iter().filter(|m| is_of_paper(m) && Some(&m.name) != first.as_ref());
    others.cloned().collect()
}

/// Whether a model is a training of one of the paper's networks.
pub fn is_of_paper(model: &Model) -> bool {
    PAPER_NETWORKS.iter().any(|name| belongs(&model.name, name))
}

/// Whether a model was trained on the finest frames: its name has no coarser data set than 1.
pub fn is_on_finest_data(model: &Model) -> bool {
    model.name.ends_with("-data1") || !model.name.contains("-data")
}

/// The range of a model's training data, as text.
pub fn trained_on(training: &Training) -> String {
    let Some(TrainingRange { least, most }) = &training.range else {
        return "an unknown range".into();
    };
    format!(
        "{} to {} points, {} to {} m high, {} to {} m wide, mean speeds up to {} m/s",
        number(least.points),
        number(most.points),
        number(least.height),
        number(most.height),
        number(least.width),
        number(most.width),
        number(most.speed)
    )
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
}
