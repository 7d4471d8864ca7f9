//! How wrong a network has been found to be.

use std::path::Path;

use dempm::trajectory::{Trajectory, TrajectoryError};
use serde::{Deserialize, Serialize};

use crate::metrics::{Errors, mean_square_distance};

/// A network that is wrong by more than this part of the motion is a rough guide.
const ROUGH: f64 = 0.1;

/// Errors on runs that a network has not learnt from: of the positions at the end of a run, root mean
/// square over the points, as parts of how far these have moved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Accuracy {
    /// Runs that it was tried on.
    pub runs: usize,
    /// Of these, where the prediction broke down; the errors are those of the others.
    pub broken: usize,
    /// Mean over the runs.
    pub mean: f64,
    /// Of the worst run.
    pub most: f64,
}

impl Accuracy {
    /// From errors and the trajectories that they are of; none if there are none.
    ///
    /// # Errors
    /// If a trajectory cannot be read.
    pub fn of<'a>(
        runs: impl IntoIterator<Item = (&'a Errors, &'a Path)>,
    ) -> Result<Option<Self>, TrajectoryError> {
        let mut found = Vec::new();
        let mut broken = 0;
        for (errors, truth) in runs {
            if errors.failure.is_some() {
                broken += 1;
            } else if let Some(last) = errors.last() {
                let motion = motion(last.time, truth)?;
                // What does not move has no part of its motion.
                if motion > 0.0 {
                    found.push((last.mse / motion).sqrt());
                }
            }
        }
        let runs = found.len() + broken;
        let mean = found.iter().sum::<f64>() / found.len().max(1) as f64;
        let most = found.iter().copied().fold(0.0, f64::max);
        Ok((runs > 0).then_some(Self { runs, broken, mean, most }))
    }

    /// What there is to say of it before a rollout.
    pub fn doubt(known: Option<&Self>) -> Option<String> {
        let Some(Self { runs, broken, mean, most }) = known else {
            return Some(
                "how wrong the network is on runs that it has not learnt from is not in its file: \
                 `surrogate eval MODEL --data DIR --record` adds it"
                    .to_owned(),
            );
        };
        let lost =
            if *broken > 0 { format!(", and broke down in {broken}") } else { String::new() };
        (*mean > ROUGH || *broken > 0).then(|| {
            format!(
                "where it was tried on what it had not learnt (runs: {runs}), the network was wrong by \
                 {:.0} % of the motion at the end, {:.0} % in the worst{lost}: a rough guide",
                100.0 * mean,
                100.0 * most
            )
        })
    }
}

/// Mean square motion from the first frame to that at a time (s), in units of the box.
fn motion(time: f64, truth: &Path) -> Result<f64, TrajectoryError> {
    let truth = Trajectory::open(truth)?;
    let frame = truth.time().iter().position(|found| *found >= time).unwrap_or(0);
    let [first, last] = [truth.frame(0)?.position, truth.frame(frame)?.position];
    Ok(mean_square_distance(&first, &last) / truth.header().domain[0].powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_accurate_says_nothing() {
        let good = Accuracy { runs: 5, broken: 0, mean: 0.02, most: 0.04 };
        assert_eq!(Accuracy::doubt(Some(&good)), None);
        assert!(Accuracy::doubt(None).unwrap().contains("--record"));
        let rough = Accuracy { mean: 0.117, most: 0.3, ..good };
        let said = Accuracy::doubt(Some(&rough)).unwrap();
        assert!(
            said.contains("runs: 5") && said.contains("12 %") && said.contains("30 %"),
            "{said}"
        );
        let lost = Accuracy { broken: 2, ..good };
        assert!(Accuracy::doubt(Some(&lost)).unwrap().contains("broke down in 2"));
    }
}
