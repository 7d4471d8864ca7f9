//! Rollouts of learned simulators beside the trajectories that they should reproduce.

use std::path::{Path, PathBuf};

use surrogate::evaluation::Errors;

use crate::context::{Context, Start};
use crate::difference::kept_difference;
use crate::models::Model;
use crate::run_cache::Run;
use crate::studies::statistics::mean;

/// A rollout with its errors.
pub struct Rollout {
    /// Name of the model.
    pub model: String,
    /// Name of the true trajectory.
    pub case: String,
    /// The predicted trajectory.
    pub output: PathBuf,
    /// The true trajectory.
    pub truth: PathBuf,
    /// Errors of the predicted frames.
    pub errors: Errors,
    /// The program's message if the rollout ended early; else empty.
    pub message: String,
}

impl Rollout {
    /// Whether it did not begin.
    pub fn is_refused(&self) -> bool {
        self.errors.errors.is_empty()
    }

    /// The first predicted frame of the truth, as text.
    pub fn first_frame(&self) -> String {
        self.errors.frames.first().map_or(String::new(), usize::to_string)
    }
}

/// Rolls models out from the first frames of trajectories, which are given with their names.
///
/// # Errors
/// If files cannot be read or the user interrupts. A rollout that ends early is a result.
pub fn roll_out(
    context: &mut Context,
    models: &[Model],
    truths: &[(String, PathBuf)],
) -> miette::Result<Vec<Rollout>> {
    let pairs = || truths.iter().flat_map(|truth| models.iter().map(move |model| (truth, model)));
    let keys: Vec<String> =
        pairs().map(|((_, truth), _)| context.hash(truth)).collect::<Result<_, _>>()?;
    let truths: Vec<&Path> = pairs().map(|((_, truth), _)| truth.as_path()).collect();
    let wanted: Vec<_> =
        pairs().map(|((_, truth), model)| (model, Start::Trajectory(truth))).collect();
    let runs = context.rollouts(&wanted, |place, run| {
        // Compares while others run. An error here occurs again below.
        let _ = errors(run, truths[place], &keys[place]);
    })?;
    let all = pairs().zip(runs).zip(&keys);
    all.map(|((((case, truth), model), run), key)| compare(model, case, truth, run, key)).collect()
}

/// Mean error (box²) of a model over its rollouts; infinite if one of them ended early.
pub fn mean_error(rollouts: &[Rollout], model: &str) -> f64 {
    let own = rollouts.iter().filter(|rollout| rollout.model == model);
    mean(&own.map(|rollout| rollout.errors.mean()).collect::<Vec<f64>>())
}

/// Errors of a rollout's predicted frames; none if it did not begin.
fn errors(run: &Run, truth: &Path, key: &str) -> miette::Result<Errors> {
    if !run.output.exists() {
        return Ok(Errors::default());
    }
    Ok(predicted(kept_difference(run, truth, key)?))
}

fn compare(
    model: &Model,
    case: &str,
    truth: &Path,
    run: Run,
    key: &str,
) -> miette::Result<Rollout> {
    let errors = errors(&run, truth, key)?;
    Ok(Rollout {
        model: model.name.clone(),
        case: case.to_owned(),
        output: run.output,
        truth: truth.to_owned(),
        errors,
        message: if run.succeeded { String::new() } else { run.message },
    })
}

/// Errors without those of the given frames, which agree exactly.
fn predicted(mut errors: Errors) -> Errors {
    let given = errors.errors.iter().take_while(|error| error.mse == 0.0).count();
    errors.errors.drain(..given);
    errors.frames.drain(..given);
    errors
}

#[cfg(test)]
mod tests {
    use surrogate::evaluation::FrameError;

    use super::*;

    impl Rollout {
        /// With these errors, a tenth of a second apart.
        pub fn of_errors(model: &str, mse: &[f64], failure: Option<&str>) -> Self {
            let error = |(k, &mse): (usize, &f64)| FrameError {
                time: 0.1 * k as f64,
                mse,
                ..FrameError::default()
            };
            let errors = Errors {
                errors: mse.iter().enumerate().map(error).collect(),
                failure: failure.map(str::to_owned),
                ..Errors::default()
            };
            let [output, truth] = [PathBuf::new(), PathBuf::new()];
            let (model, case, message) = (model.to_owned(), String::new(), String::new());
            Self { model, case, output, truth, errors, message }
        }
    }

    #[test]
    fn given_frames_do_not_count() {
        let error = |mse| FrameError { mse, ..FrameError::default() };
        let errors = Errors {
            frames: vec![1, 2, 3, 4],
            errors: [0.0, 0.0, 1e-6, 0.0].map(error).to_vec(),
            ..Errors::default()
        };
        let predicted = predicted(errors);
        assert_eq!(predicted.frames, [3, 4]);
        assert_eq!(predicted.mean(), 5e-7);
    }
}
