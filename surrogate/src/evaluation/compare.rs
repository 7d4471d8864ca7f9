//! Compares rollouts with trajectories.

use std::path::{Path, PathBuf};

use dempm::trajectory::Trajectory;

use super::error::EvaluationError;
use super::metrics::{Errors, Measure};
use super::seeds::stem;
use crate::rollout::{InitialFrames, InitialFramesError, Rollout, stride};
use crate::simulator::Simulator;

/// A trajectory and what was compared with it.
pub struct Case {
    /// The trajectory file.
    pub path: PathBuf,
    /// Errors of the rollout.
    pub rollout: Errors,
    /// Differences to a run of the same scene with another packing, over the same frames.
    pub floor: Option<Errors>,
}

/// Rolls a model out from the first frames of a trajectory and compares it with the rest, up to
/// `frames` frames.
///
/// A rollout that fails is a result, not an error: its errors end there and state why.
///
/// # Errors
/// If the trajectory cannot be read or the model cannot start from it.
pub fn compare(
    simulator: &Simulator,
    path: &Path,
    frames: Option<usize>,
) -> Result<Errors, InitialFramesError> {
    let initial = InitialFrames::from_trajectory(path, 0, simulator)?;
    let truth = Trajectory::open(path)?;
    let header = truth.header();
    let stride = stride(simulator.training.frame_interval, header.frame_interval, || stem(path))?;
    let mut errors = Errors { case: stem(path), ..Errors::default() };
    let measure = measure(&truth);
    let mut rollout = Rollout::new(simulator, &initial);
    let last = frames.unwrap_or(initial.frames).min(initial.frames).saturating_sub(1);
    let failure = rollout.up_to(last, |rollout| {
        let frame = rollout.frame();
        let truth = truth.frame(frame * stride)?;
        errors.frames.push(frame);
        errors.errors.push(measure.between(rollout.last(), &truth.position, truth.time));
        Ok::<_, InitialFramesError>(())
    })?;
    errors.failure = failure.map(|error| error.to_string());
    Ok(errors)
}

/// Compares the run `twin` with another of the same scene, but another packing, in the frames that
/// a rollout predicts. No surrogate can be expected to be closer.
///
/// # Errors
/// If a file cannot be read, or the runs are of different scenes.
pub fn noise_floor(
    simulator: &Simulator,
    path: &Path,
    twin: &Path,
    frames: Option<usize>,
) -> Result<Errors, EvaluationError> {
    let [truth, other] = [Trajectory::open(path)?, Trajectory::open(twin)?];
    let (header, found) = (truth.header(), other.header());
    let alike = truth.points().mass.len() == other.points().mass.len()
        && header.domain == found.domain
        && header.frame_interval == found.frame_interval;
    if !alike {
        return Err(EvaluationError::OtherScene { path: path.to_owned(), other: twin.to_owned() });
    }
    let stride = stride(simulator.training.frame_interval, header.frame_interval, || stem(path))?;
    let measure = measure(&truth);
    let made = truth.frames().min(other.frames()).div_ceil(stride);
    let mut errors = Errors { case: format!("{} floor", stem(path)), ..Errors::default() };
    for frame in simulator.first_frames()..frames.unwrap_or(made).min(made) {
        let (one, another) = (truth.frame(frame * stride)?, other.frame(frame * stride)?);
        errors.frames.push(frame);
        errors.errors.push(measure.between(&another.position, &one.position, one.time));
    }
    Ok(errors)
}

fn measure(truth: &Trajectory) -> Measure {
    let header = truth.header();
    let mass = truth.points().mass.clone();
    Measure { mass, spacing: header.point_spacing, width: header.domain[0] }
}
