//! Checks on the initial frames.

use super::training_range::FlowState;
use crate::rollout::InitialFrames;
use crate::simulator::Simulator;

/// Initial velocities or accelerations are unlike the training data from this root mean square on,
/// in standard deviations of the training data (1 in training).
const OUTLIER: f64 = 4.0;

/// What of a scene and the frames that a rollout starts from lies outside of what the model has learnt, in numbers;
/// `None` if nothing does.
pub fn start_checks(simulator: &Simulator, initial: &InitialFrames) -> Option<String> {
    let mut outside = training_range(simulator, initial);
    outside.extend(motion(simulator, initial));
    outside.extend(unseen_boxes(simulator, initial));
    let known = simulator.training.range.is_some();
    match (outside.is_empty(), known) {
        (true, true) => None,
        (true, false) => Some(UNKNOWN_RANGE.to_owned()),
        (false, true) => Some(format!("outside the training data: {}", outside.join("; "))),
        (false, false) => Some(format!("{UNKNOWN_RANGE}; besides: {}", outside.join("; "))),
    }
}

const UNKNOWN_RANGE: &str = "the model file does not state the range of its training data: `surrogate \
                             stats DATA --into MODEL` adds it";

/// Boxes that act on the points, but are no input of the network.
fn unseen_boxes(simulator: &Simulator, initial: &InitialFrames) -> Option<String> {
    let (obstacles, plate) = (!initial.scene.obstacles.is_empty(), initial.scene.plate.is_some());
    let config = &simulator.config;
    let unseen = match (obstacles && !config.sees_boxes(), plate && !config.sees_surfaces()) {
        (true, true) => "obstacles and the plate",
        (true, false) => "obstacles",
        (false, true) => "the plate",
        (false, false) => return None,
    };
    Some(format!("{unseen}, which the network does not see: points are stopped only on contact"))
}

/// Compares the initial frames with the range of the training data.
fn training_range(simulator: &Simulator, initial: &InitialFrames) -> Vec<String> {
    let Some(range) = &simulator.training.range else { return Vec::new() };
    let interval = simulator.training.frame_interval;
    let [a, b, c] = &initial.window(3, interval)[..] else { return Vec::new() };
    range.outside(&FlowState::measure([a, b, c], interval, simulator.config.connection_radius))
}

/// Velocities and accelerations far above those of the training data.
fn motion(simulator: &Simulator, initial: &InitialFrames) -> Vec<String> {
    let window = initial.window(3, simulator.training.frame_interval);
    let [.., first, second, third] = window.as_slice() else { return Vec::new() };
    let n = &simulator.normalisation;
    let fall =
        if simulator.training.without_gravity { free_fall(simulator, initial) } else { [0.0; 2] };
    let rms = |value: &dyn Fn(usize, usize) -> f64| {
        let axis = |k: usize| (0..third.len()).map(|p| value(p, k).powi(2)).sum::<f64>();
        ((axis(0) + axis(1)) / (2.0 * third.len().max(1) as f64)).sqrt()
    };
    let velocity =
        |p: usize, k: usize| (third[p][k] - second[p][k] - n.velocity_mean[k]) / n.velocity_std[k];
    let acceleration = |p: usize, k: usize| {
        let a = third[p][k] - 2.0 * second[p][k] + first[p][k];
        (a - fall[k] - n.acceleration_mean[k]) / n.acceleration_std[k]
    };
    [("velocities", rms(&velocity)), ("accelerations", rms(&acceleration))]
        .into_iter()
        .filter(|(_, ratio)| *ratio > OUTLIER)
        .map(|(what, ratio)| format!("initial {what} {ratio:.0} times those in training"))
        .collect()
}

/// Gravity, m/frame².
fn free_fall(simulator: &Simulator, initial: &InitialFrames) -> [f64; 2] {
    initial.scene.gravity.map(|g| g * simulator.training.frame_interval.powi(2))
}
