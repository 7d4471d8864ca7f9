//! What there is to say of a start before anything is predicted from it.

use crate::accuracy::Accuracy;
use crate::range::Look;
use crate::simulator::Simulator;
use crate::start::Start;

/// Root mean square of velocities or accelerations in units of the training's standard deviations
/// (1 in training) from which on a start is unlike all training.
const STRANGE: f64 = 4.0;
/// Everything that is doubtful but [mirror images](crate::asymmetry), which take a few predictions.
pub fn doubts(simulator: &Simulator, start: &Start) -> Vec<String> {
    let mut said = Vec::new();
    let unseen = match (start.scene.obstacles.is_empty(), start.scene.plate.is_some()) {
        (false, false) if !simulator.config.obstacles => Some("obstacles"),
        (false, true) if !simulator.config.obstacles => Some("obstacles and plate"),
        (_, true) => Some("plate"),
        _ => None,
    };
    said.extend(unseen.map(|what| {
        format!("{what}: points that touch them are stopped, but the network does not see them")
    }));
    said.extend(range(simulator, start));
    said.extend(Accuracy::doubt(simulator.training.accuracy.as_ref()));
    said.extend(motion(simulator, start));
    said
}

/// Whether the network has learnt from starts like this one.
fn range(simulator: &Simulator, start: &Start) -> Option<String> {
    let Some(range) = &simulator.training.range else {
        return Some(
            "what the network was trained on is not in its file: `surrogate stats DATA --into \
             MODEL` adds it"
                .to_owned(),
        );
    };
    let interval = simulator.training.frame_interval;
    let [a, b, c] = &start.window(3, interval)[..] else { return None };
    range.doubt(&Look::at([a, b, c], interval, simulator.config.connection_radius))
}

/// Velocities and accelerations that no training had.
fn motion(simulator: &Simulator, start: &Start) -> Vec<String> {
    let window = start.window(3, simulator.training.frame_interval);
    let [.., first, second, third] = window.as_slice() else { return Vec::new() };
    let n = &simulator.normalisation;
    let fall =
        if simulator.training.without_gravity { free_fall(simulator, start) } else { [0.0; 2] };
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
    [("fast", rms(&velocity)), ("much accelerated", rms(&acceleration))]
        .into_iter()
        .filter(|(_, size)| *size > STRANGE)
        .map(|(what, size)| {
            format!(
                "the start is {size:.0} times as {what} as the training data were on average: do \
                 not trust the prediction"
            )
        })
        .collect()
}

/// Gravity, m/frame².
fn free_fall(simulator: &Simulator, start: &Start) -> [f64; 2] {
    start.scene.gravity.map(|g| g * simulator.training.frame_interval.powi(2))
}
