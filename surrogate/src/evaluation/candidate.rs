//! A network among the candidates of `dempm choose`.
//!
//! What is known of its error follows from the rollout itself, so it is made, and not kept.

use std::convert::Infallible;
use std::time::Instant;

use dempm::choose::{Expected, Learned, LearnedError};
use dempm::memory;
use dempm::scene::Scene;

use crate::diagnostics::{ErrorFeatures, ErrorModel, ExpectedError, start_checks};
use crate::rollout::{
    InitialFrames, InitialFramesError, Rollout, discs_on_grid_of_training, stride,
};
use crate::simulator::Simulator;

/// What the error has to be the distance from.
const TRUTH: &str = "discs";

/// What a network of this name expects of a scene, whichever model the scene names.
///
/// # Errors
/// If the first frames cannot be simulated.
pub fn candidate(
    simulator: &Simulator,
    name: &str,
    scene: &Scene,
) -> Result<Learned, InitialFramesError> {
    let began = Instant::now();
    let scene = discs_on_grid_of_training(simulator, scene);
    let mut found = Learned {
        name: format!("network {name}"),
        scene: scene.text.clone(),
        frame_interval: simulator.training.frame_interval,
        error: None,
        seconds: None,
        memory: None,
        out: None,
    };
    let model = match error_model(simulator, &scene) {
        Ok(model) => model,
        Err(why) => return Ok(Learned { out: Some(why), ..found }),
    };
    let initial = InitialFrames::of_scene(&scene, simulator)?;
    if let Some(outside) = start_checks(simulator, &initial) {
        return Ok(Learned { out: Some(outside), ..found });
    }
    match expected(simulator, model, &initial) {
        Ok(error) => found.error = Some(error),
        Err(why) => found.out = Some(why),
    }
    found.seconds = Some(began.elapsed().as_secs_f64());
    found.memory = memory::peak();
    Ok(found)
}

/// The calibration of a network whose frames are some of those of the scene, or why it does not serve.
fn error_model<'a>(simulator: &'a Simulator, scene: &Scene) -> Result<&'a ErrorModel, String> {
    let training = &simulator.training;
    let (own, asked) = (training.frame_interval, scene.frame_interval);
    if stride(own, asked, String::new).is_err() {
        return Err(format!("its frames are {own} s apart, those of the scene {asked} s"));
    }
    let unknown = "its error is unknown: `surrogate calibrate-error` measures it";
    let model = training.error.as_ref().ok_or(unknown)?;
    match model.truth.as_deref() {
        Some(other) if other != TRUTH => {
            Err(format!("its error is that from `{other}`, not discs"))
        }
        _ => Ok(model),
    }
}

/// The error to expect at the end of a rollout, and the largest over time; or why the rollout fails.
fn expected(
    simulator: &Simulator,
    model: &ErrorModel,
    initial: &InitialFrames,
) -> Result<LearnedError, String> {
    let nothing = Expected { median: 0.0, bound: 0.0 };
    let mut error = LearnedError { end: nothing, largest: nothing };
    let mut features = ErrorFeatures::new(simulator, initial);
    let mut rollout = Rollout::new(simulator, initial);
    let last = initial.frames - 1;
    let Ok(failure) = rollout.up_to(last, |rollout| {
        features.observe(rollout.before(), rollout.last());
        let frame = rollout.frame();
        let part = frame as f64 / last as f64;
        let ExpectedError { median, bound } =
            model.expected(part, &features.at(frame, rollout.last()));
        error.end = Expected { median, bound };
        error.largest.median = error.largest.median.max(median);
        error.largest.bound = error.largest.bound.max(bound);
        Ok::<_, Infallible>(())
    });
    match failure {
        Some(failure) => Err(format!("its prediction fails: {failure}")),
        None => Ok(error),
    }
}
