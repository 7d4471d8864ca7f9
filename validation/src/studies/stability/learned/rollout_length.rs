//! Rollouts that go on long after a collapse.

use surrogate::simulator::Simulator;

use super::rollout::{Teacher, WRONG, column, difference, roll};
use crate::studies::stability::outcome::Outcome;
use crate::studies::stability::study::{Axis, Chart, Curve, Finding, Map, Study, StudyError};
use crate::studies::stability::threshold::Threshold;
use crate::suite::Suite;

/// Time that a rollout lasts (s); a collapse takes 1.2 s of it.
const LENGTH: f64 = 4.8;

/// Predicts a collapse and what follows.
///
/// # Errors
/// If a study's own scene or packing cannot be made; failures under study are results.
pub fn study(suite: Suite, simulator: &Simulator) -> Result<Study, StudyError> {
    let (teacher, interval) = (Teacher::of(simulator), simulator.training.frame_interval);
    let frames = (LENGTH / interval).round() as usize + 1;
    let body = column([0.5, 0.0], [1.0, suite.pick(0.75, 1.0)], [0.0, 0.0]);
    let direct = teacher.run("collapse", [4.0, 2.0], &body, frames)?;
    let truth = &direct.positions;
    let rolled = roll(simulator, &direct.start(simulator)?, frames);
    let looks: Vec<usize> = (1..=8)
        .map(|k| k * (frames - 1) / 8)
        .filter(|&frame| frame < rolled.positions.len())
        .collect();
    let error = |frame: usize| rolled.relative_error(truth, frame);
    let judge = |frame: usize| {
        let symptom = format!("wrong by {:.0} % of the motion", 100.0 * error(frame));
        Outcome::of((error(frame) > WRONG).then_some(symptom), rolled.said())
    };
    let time = |frame: usize| frame as f64 * interval;
    let sweep = looks.iter().map(|&k| (time(k), judge(k).works()));
    let beyond = looks.iter().map(|&k| judge(k)).find(|o| !o.works());
    let (_, end) = rolled.judge(truth);
    // Mean speed of the points over the last quarter, in which all is at rest.
    let last = rolled.positions.len() - 1;
    let from = last - last / 4;
    let creep =
        |f: &super::rollout::Frames| 1e3 * difference(&f[last], &f[from]) / time(last - from);
    Ok(Study {
        method: format!(
            "A column 1 m wide collapses, which takes 1.2 s, and the rollout goes on to {LENGTH} s, \
             longer than trainings last. Truth is {}. Failure: the root mean square error exceeds \
             {WRONG} of the root mean square motion.",
            teacher.name()
        ),
        findings: vec![
            Finding {
                case: "length of the rollout".into(),
                parameter: "time, s".into(),
                measured: Threshold::of_sweep(sweep),
                theory: None,
                beyond: beyond.unwrap_or(end),
            },
            Finding {
                case: format!(
                    "residual creep in the last quarter ({:.1} mm/s in the truth)",
                    creep(truth)
                ),
                parameter: "mean speed, mm/s".into(),
                measured: Threshold::Between(creep(&rolled.positions), creep(&rolled.positions)),
                theory: Some((0.0, "at rest".into())),
                beyond: Outcome::of(
                    (creep(&rolled.positions) > 10.0 + creep(truth)).then(|| "creeps".into()),
                    rolled.said(),
                ),
            },
        ],
        charts: vec![Chart {
            title: "Error over time".into(),
            x: "time, s".into(),
            y: "error over motion".into(),
            log: [false, false],
            curves: vec![
                Curve::measured(
                    "rollout",
                    (simulator.first_frames()..rolled.positions.len())
                        .step_by((frames / 40).max(1))
                        .map(|k| [time(k), error(k)])
                        .collect(),
                ),
                Curve::theory("failure", vec![[0.0, WRONG], [time(frames - 1), WRONG]]),
            ],
            caption: String::new(),
        }],
        maps: vec![Map {
            title: "Length of the rollout".into(),
            x: Axis::new("time, s", looks.iter().map(|&k| time(k)).collect()),
            y: Axis::named("scene", vec!["column collapse".into()]),
            numbers: vec![looks.iter().map(|&k| error(k)).collect()],
            outcomes: vec![looks.iter().map(|&k| judge(k)).collect()],
            caption: "Numbers: error over motion.".into(),
        }],
        pictures: vec![rolled.picture(format!("Rollout at {:.2} s", time(last)), truth, &direct)],
        ..Study::default()
    })
}
