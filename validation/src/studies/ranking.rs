//! Models ranked by their mean error over the same cases.

use std::cmp::Ordering;

use surrogate::simulator::Simulator;

use crate::models::Model;
use crate::studies::rollouts::{Rollout, mean_error};
use crate::studies::statistics::mean;

/// Models, the best first.
pub struct Ranking {
    /// The models with their errors.
    pub ranked: Vec<Ranked>,
    /// Number of cases of each model.
    pub cases: usize,
    /// Time (s) at which the first of all rollouts ended early; `None` if none did.
    pub horizon: Option<f64>,
}

/// A model among others.
pub struct Ranked {
    /// Name of the model.
    pub model: String,
    /// Number of parameters.
    pub parameters: usize,
    /// Training steps.
    pub steps: usize,
    /// Number of rollouts that reached the end.
    pub completed: usize,
    /// Mean error (box²); infinite if a rollout ended early.
    pub error: f64,
    /// Mean error until the ranking's horizon, if there is one.
    pub early: Option<f64>,
}

impl Ranking {
    /// Ranks models by rollouts of the same cases.
    ///
    /// # Errors
    /// If the weights of a model cannot be read.
    pub fn of(models: &[Model], rollouts: &[Rollout]) -> miette::Result<Self> {
        let horizon = first_end(rollouts);
        let ranked = models.iter().map(|model| {
            let Simulator { config, training, .. } = Simulator::load(&model.path)?;
            let size = (config.parameter_count(), training.steps as usize);
            Ok(Ranked::of(&model.name, size, rollouts, horizon))
        });
        let mut ranked: Vec<Ranked> = ranked.collect::<miette::Result<_>>()?;
        ranked.sort_by(Ranked::compare);
        let first = models.first().map(|model| model.name.as_str());
        let cases = rollouts.iter().filter(|r| Some(r.model.as_str()) == first).count();
        Ok(Self { ranked, cases, horizon })
    }
}

impl Ranked {
    fn of(
        model: &str,
        (parameters, steps): (usize, usize),
        rollouts: &[Rollout],
        horizon: Option<f64>,
    ) -> Self {
        let own: Vec<&Rollout> = rollouts.iter().filter(|r| r.model == model).collect();
        let completed = |r: &&&Rollout| r.errors.failure.is_none() && !r.is_refused();
        let until = |horizon: f64| {
            let errors = own.iter().flat_map(|r| &r.errors.errors);
            let mse: Vec<f64> = errors.filter(|e| e.time <= horizon).map(|e| e.mse).collect();
            (!mse.is_empty()).then(|| mean(&mse))
        };
        Self {
            model: model.to_owned(),
            parameters,
            steps,
            completed: own.iter().filter(completed).count(),
            error: mean_error(rollouts, model),
            early: horizon.and_then(until),
        }
    }

    /// The best first: by mean error, then by the number of completed cases.
    fn compare(&self, other: &Self) -> Ordering {
        let early = |ranked: &Self| ranked.early.unwrap_or(f64::INFINITY);
        self.error
            .total_cmp(&other.error)
            .then(other.completed.cmp(&self.completed))
            .then(early(self).total_cmp(&early(other)))
    }
}

/// Time (s) of the last frame of the rollout that ended first of those that ended early.
fn first_end(rollouts: &[Rollout]) -> Option<f64> {
    let early = rollouts.iter().filter(|rollout| rollout.errors.failure.is_some());
    let ends = early.filter_map(|rollout| Some(rollout.errors.errors.last()?.time));
    ends.min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_ends_early_comes_last_and_can_still_be_compared() {
        let rollouts = [
            Rollout::of_errors("early", &[1.0, 2.0], Some("crowded")),
            Rollout::of_errors("early", &[1.0, 2.0, 3.0], None),
            Rollout::of_errors("good", &[2.0, 2.0, 2.0], None),
            Rollout::of_errors("good", &[2.0, 2.0, 2.0], None),
            Rollout::of_errors("worse", &[3.0, 3.0, 3.0], Some("crowded")),
            Rollout::of_errors("worse", &[3.0, 3.0, 3.0], Some("crowded")),
            Rollout::of_errors("fair", &[1.0, 1.0, 9.0], None),
            Rollout::of_errors("fair", &[1.0, 1.0, 9.0], None),
        ];
        let horizon = first_end(&rollouts);
        assert_eq!(horizon, Some(0.1));
        let models = ["worse", "early", "fair", "good"];
        let mut ranked: Vec<Ranked> =
            models.iter().map(|model| Ranked::of(model, (0, 0), &rollouts, horizon)).collect();
        ranked.sort_by(Ranked::compare);
        let found: Vec<_> =
            ranked.iter().map(|r| (r.model.as_str(), r.completed, r.error, r.early)).collect();
        let expected = [
            ("good", 2, 2.0, Some(2.0)),
            ("fair", 2, 11.0 / 3.0, Some(1.0)),
            ("early", 1, f64::INFINITY, Some(1.5)),
            ("worse", 0, f64::INFINITY, Some(3.0)),
        ];
        assert_eq!(found, expected);
    }
}
