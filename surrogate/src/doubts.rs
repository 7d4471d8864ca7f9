//! What there is to say of a start before anything is predicted from it.

use crate::constraints::Constraints;
use crate::features::{Obstacle, Window};
use crate::node_features::columns;
use crate::range::Look;
use crate::simulator::Simulator;
use crate::start::Start;

/// Root mean square of velocities or accelerations in units of the training's standard deviations
/// (1 in training) from which on a start is unlike all training.
const STRANGE: f64 = 4.0;
/// Part of the accelerations by which those of the mirrored start may differ. In a collapse mirror
/// images may part by more: six rollouts of three networks ended 0.4 to 2.3 times as much of their
/// motion apart (`validation report`, "Mirror asymmetry"), for which this is where a tenth of it
/// begins. Others grow more from less.
const ASYMMETRY: f64 = 0.04;
/// The largest of those ratios.
const WORST: f64 = 2.3;
/// So many points tell how symmetric a network is: two predictions for them cost little.
const SAMPLE: usize = 512;

/// Everything that is doubtful.
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
    said.extend(motion(simulator, start));
    said.extend(asymmetry(simulator, start));
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

/// Physics knows no left and right, but a network may.
fn asymmetry(simulator: &Simulator, start: &Start) -> Option<String> {
    if simulator.mirror {
        return None;
    }
    let difference = mirror_difference(simulator, start);
    (difference > ASYMMETRY).then(|| {
        format!(
            "the mirror image of the start gets forces that differ by {:.0} %, and may end {:.0} % of \
             the motion elsewhere: --mirror averages both",
            100.0 * difference,
            100.0 * WORST * difference
        )
    })
}

/// Root mean square difference of a(X) and M a(M X), see [`Simulator::accelerations`], over the
/// root mean square of what moves points other than gravity, or of accelerations in training if
/// that is larger. Of the points nearest to the middle, as a block of their own.
pub fn mirror_difference(simulator: &Simulator, start: &Start) -> f64 {
    let chosen = middle(&start.positions[start.positions.len() - 1]);
    let width = start.scene.domain.size[0];
    let window = start.window(simulator.config.window(), simulator.training.frame_interval);
    let [_, columns] = columns(&simulator.config.node_features, simulator.config.dimensions);
    let statics: Vec<f32> = chosen
        .iter()
        .flat_map(|&p| start.statics[p * columns..(p + 1) * columns].iter().copied())
        .collect();
    let fall = free_fall(simulator, start);
    let predicted = |reflect: &dyn Fn(f64) -> f64, gravity: [f64; 2]| {
        let of_frame = |frame: &Vec<[f64; 2]>| {
            let point = |&p: &usize| [reflect(frame[p][0]) as f32, frame[p][1] as f32];
            chosen.iter().flat_map(point).collect::<Vec<f32>>()
        };
        let positions: Vec<f32> = window.iter().flat_map(of_frame).collect();
        let obstacles: Vec<Obstacle> = Constraints::new(&start.scene)
            .obstacles()
            .into_iter()
            .map(|[[a, bottom], [b, top]]| {
                let [a, b] = [a, b].map(|x| reflect(f64::from(x)) as f32);
                [[a.min(b), bottom], [a.max(b), top]]
            })
            .collect();
        let (points, statics) = (chosen.len(), &statics);
        let window = Window { positions: &positions, points, statics, obstacles: &obstacles };
        let domain = start.scene.domain.size;
        simulator.accelerations(&mut simulator.inference(), &window, domain, gravity)
    };
    let straight = predicted(&|x| x, fall);
    let mirrored = predicted(&|x| width - x, [-fall[0], fall[1]]);
    let rms = |sum: f64| (sum / straight.len().max(1) as f64).sqrt();
    let (mut apart, mut pushed) = (0.0, 0.0);
    for (a, b) in straight.as_chunks::<2>().0.iter().zip(mirrored.as_chunks::<2>().0) {
        apart += (a[0] + b[0]).powi(2) + (a[1] - b[1]).powi(2);
        pushed += (a[0] - fall[0]).powi(2) + (a[1] - fall[1]).powi(2);
    }
    let trained = simulator.normalisation.acceleration_std.iter().map(|s| s * s).sum::<f64>();
    rms(apart) / rms(pushed).max((0.5 * trained).sqrt())
}

/// The points nearest to the middle of all.
fn middle(positions: &[[f64; 2]]) -> Vec<usize> {
    let mean =
        [0, 1].map(|k| positions.iter().map(|x| x[k]).sum::<f64>() / positions.len().max(1) as f64);
    let away = |p: usize| (positions[p][0] - mean[0]).hypot(positions[p][1] - mean[1]);
    let mut points: Vec<usize> = (0..positions.len()).collect();
    points.sort_by(|&a, &b| away(a).total_cmp(&away(b)));
    points.truncate(SAMPLE);
    points
}
