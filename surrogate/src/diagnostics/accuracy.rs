//! Accuracy of a network on runs that it has not learnt from.

use std::path::Path;

use dempm::trajectory::{Trajectory, TrajectoryError};
use serde::{Deserialize, Serialize};

use crate::evaluation::{Errors, mean_square_distance};

/// Errors of the final positions in runs that a network has not learnt from: root mean square over
/// the points, as fractions of their motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Accuracy {
    /// Number of runs.
    pub runs: usize,
    /// Runs in which the prediction failed; the errors are those of the others.
    pub broken: usize,
    /// Mean error.
    pub mean: f64,
    /// Error of the worst run.
    pub most: f64,
}

impl Accuracy {
    /// From the errors of rollouts and the trajectories they reproduce; `None` if nothing moves.
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
                // Without motion there is no fraction of it.
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

    /// The errors in words.
    pub fn statement(&self) -> String {
        let Self { runs, broken, mean, most } = self;
        let failed =
            if *broken > 0 { format!("; {broken} predictions failed") } else { String::new() };
        format!(
            "on {runs} unseen runs, final positions were off by {:.0} % of the motion, by {:.0} % in the \
             worst{failed}",
            100.0 * mean,
            100.0 * most
        )
    }
}

/// Mean square motion from the first frame to the one at `time` (s), in units of the domain's width.
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
    fn errors_are_stated_in_per_cent() {
        let rough = Accuracy { runs: 5, broken: 2, mean: 0.117, most: 0.3 };
        let said = rough.statement();
        for part in ["5 unseen runs", "12 %", "30 %", "2 predictions failed"] {
            assert!(said.contains(part), "{said}");
        }
    }
}
