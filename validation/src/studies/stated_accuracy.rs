//! The errors that the paper's text states, and ours.

use dempm::trajectory::Trajectory;

use crate::context::Context;
use crate::literature::paper::{GIVEN_FRAMES, STATED_ERRORS, StatedError, When};
use crate::models::{Model, of_packings};
use crate::studies::rollouts::{Rollout, roll_out};

/// A stated error and what a network of ours reaches.
pub struct Reached {
    /// What the paper states.
    pub paper: &'static StatedError,
    /// Name of our network; empty without one.
    pub network: String,
    /// Its error (box²); `None` without a rollout that got so far.
    pub error: Option<f64>,
    /// First predicted frame, as text.
    pub first_frame: String,
    /// Whether it is given no more frames than the paper's network.
    pub is_fair: bool,
    /// Width of the box, m; 0 without a rollout.
    pub width: f64,
}

/// The network that comes nearest to the paper.
pub struct Nearest<'r> {
    /// Its name.
    pub network: &'r str,
    /// Its errors.
    pub reached: Vec<&'r Reached>,
}

/// Our networks' errors on all stated cases: one entry for each case and network, and one for each
/// case without a rollout.
///
/// # Errors
/// If a file cannot be read, a rollout cannot be made or the user interrupts.
pub fn measure(context: &mut Context) -> miette::Result<Vec<Reached>> {
    let models = of_packings(&context.models);
    let mirrored = models.first().map(Model::mirrored);
    let models: Vec<Model> = models.into_iter().chain(mirrored).collect();
    let mut all = Vec::new();
    for paper in &STATED_ERRORS {
        let mut cases = context.cases(paper.set);
        cases.retain(|(name, _)| name == paper.case);
        let rollouts = roll_out(context, &models, &cases)?;
        if rollouts.is_empty() {
            let (network, first_frame) = (String::new(), String::new());
            let (error, is_fair, width) = (None, false, 0.0);
            all.push(Reached { paper, network, error, first_frame, is_fair, width });
        }
        for rollout in rollouts {
            all.push(Reached {
                paper,
                error: error(&rollout, paper.when),
                first_frame: rollout.first_frame(),
                is_fair: rollout.errors.frames.first().is_some_and(|k| *k <= GIVEN_FRAMES),
                width: Trajectory::open(&rollout.truth)?.header().domain[0],
                network: rollout.model,
            });
        }
    }
    Ok(all)
}

/// The network that comes nearest to the paper's errors, of those that are given as few frames and
/// have the most values. `None` if there is no value.
pub fn nearest(all: &[Reached]) -> Option<Nearest<'_>> {
    let fair = |reached: &&Reached| reached.is_fair && reached.error.is_some();
    let mut networks: Vec<&str> = all.iter().filter(fair).map(|r| r.network.as_str()).collect();
    networks.sort_unstable();
    networks.dedup();
    let of = |network: &str| -> Vec<&Reached> {
        all.iter().filter(fair).filter(|r| r.network == network).collect()
    };
    let excess = |network: &str| -> f64 {
        of(network).iter().filter_map(|r| Some((r.error? / r.paper.mse).ln())).sum()
    };
    let most = networks.iter().map(|network| of(network).len()).max()?;
    let complete = networks.into_iter().filter(|network| of(network).len() == most);
    let network = complete.min_by(|a, b| excess(a).total_cmp(&excess(b)))?;
    Some(Nearest { network, reached: of(network) })
}

impl Nearest<'_> {
    /// How many of its errors are no larger than the paper's.
    pub fn met(&self) -> usize {
        let met = |reached: &&&Reached| reached.error.is_some_and(|e| e <= reached.paper.mse);
        self.reached.iter().filter(met).count()
    }

    /// Our largest root mean square distance and the paper's in the same case, m.
    pub fn worst(&self) -> Option<[f64; 2]> {
        let metres = |mse: f64, reached: &Reached| mse.sqrt() * reached.width;
        let pairs = self.reached.iter().filter_map(|reached| {
            Some([metres(reached.error?, reached), metres(reached.paper.mse, reached)])
        });
        pairs.max_by(|a, b| a[0].total_cmp(&b[0]))
    }
}

fn error(rollout: &Rollout, when: When) -> Option<f64> {
    let errors = &rollout.errors;
    match when {
        When::Frame(frame) => {
            let place = errors.frames.iter().position(|found| *found >= frame)?;
            Some(errors.errors[place].mse)
        }
        // A rollout that ended early has neither.
        _ if errors.failure.is_some() => None,
        When::Peak => Some(errors.peak()?.0.mse),
        When::End => Some(errors.last()?.mse),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_network_nearest_to_the_paper_leads() {
        let reached = |network: &str, case: usize, part: f64| Reached {
            paper: &STATED_ERRORS[case],
            network: network.to_owned(),
            error: Some(part * STATED_ERRORS[case].mse),
            first_frame: String::new(),
            is_fair: true,
            width: 10.0,
        };
        let all = [
            reached("near", 0, 2.0),
            reached("near", 1, 0.5),
            reached("far", 0, 1.0),
            reached("far", 1, 100.0),
            reached("incomplete", 0, 0.01),
        ];
        let nearest = nearest(&all).unwrap();
        assert_eq!((nearest.network, nearest.reached.len(), nearest.met()), ("near", 2, 1));
        // Col5x2: half of 1e-4 in a box of 10 m.
        let [ours, paper] = nearest.worst().unwrap();
        assert!((ours - 0.005_f64.sqrt()).abs() < 1e-12 && (paper - 0.1).abs() < 1e-12);
        assert!(super::nearest(&[]).is_none());
    }
}
