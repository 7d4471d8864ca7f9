//! True errors of rollouts with what is known of them without the truth.

use std::convert::Infallible;
use std::path::Path;

use dempm::comparison::common_frames;
use dempm::trajectory::Trajectory;

use super::metrics::mean_square_distance;
use super::seeds::stem;
use crate::diagnostics::{ErrorFeatures, ErrorSample, PARTS};
use crate::rollout::{InitialFrames, InitialFramesError, Rollout};
use crate::simulator::Simulator;

/// Rolls a model out from the first frames of a trajectory. A failure ends the sample early.
///
/// # Errors
/// If the trajectory cannot be read or the model cannot start from it.
pub fn error_sample(simulator: &Simulator, path: &Path) -> Result<ErrorSample, InitialFramesError> {
    let initial = InitialFrames::from_trajectory(path, 0, simulator)?;
    let truth = Trajectory::open(path)?;
    let interval = simulator.training.frame_interval;
    let times: Vec<f64> = (0..initial.frames).map(|k| initial.time + k as f64 * interval).collect();
    let pairs = common_frames(&[&times, truth.time()]);
    let mut follow = ErrorFeatures::new(simulator, &initial);
    let mut rollout = Rollout::new(simulator, &initial);
    let (mut features, mut errors) = (Vec::new(), Vec::new());
    let last = initial.frames - 1;
    for part in 1..=PARTS {
        let frame = (last * part / PARTS).max(initial.positions.len());
        let Ok(failure) = rollout.up_to(frame, |rollout| {
            follow.observe(rollout.before(), rollout.last());
            Ok::<_, Infallible>(())
        });
        if failure.is_some() {
            break;
        }
        let Some(pair) = pairs.iter().find(|pair| pair[0] == frame) else { break };
        let true_positions = truth.frame(pair[1])?.position;
        features.push(follow.at(frame, rollout.last()));
        errors.push(mean_square_distance(rollout.last(), &true_positions).sqrt());
    }
    Ok(ErrorSample { scene: stem(path), features, errors })
}
