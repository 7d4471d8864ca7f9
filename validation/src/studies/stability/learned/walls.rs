//! A block thrown at a wall, ever faster: points that pass through it.

use surrogate::simulator::Simulator;

use super::rollout::{Teacher, WRONG, column, roll};
use crate::studies::stability::outcome::Outcome;
use crate::studies::stability::study::{Axis, Finding, Map, Picture, Study, StudyError};
use crate::studies::stability::threshold::Threshold;
use crate::suite::Suite;

/// Distance of the block from the wall it is thrown at (m), in a domain of 4 x 2 m.
const GAP: f64 = 0.5;

struct Case {
    error: f64,
    outcome: Outcome,
    picture: Picture,
}

fn run(simulator: &Simulator, speed: f64) -> Result<Case, StudyError> {
    let interval = simulator.training.frame_interval;
    let window = simulator.first_frames();
    // The block is still free while the model looks.
    let gap = GAP.max(1.2 * speed * interval * window as f64);
    let gap = (gap / 0.125).ceil() * 0.125;
    let frames = window + (1.5 * gap / speed / interval).ceil() as usize + 5;
    let block = column([gap, 0.5], [0.5, 0.5], [-speed, 0.0]);
    let teacher = Teacher::of(simulator);
    let direct = teacher.run("block thrown at a wall", [4.0 + gap, 2.0], &block, frames)?;
    let rolled = roll(simulator, &direct.start(simulator)?, frames);
    let through = rolled.positions.iter().flatten().filter(|x| x[0] < 0.0 || x[1] < 0.0).count();
    let (error, outcome) = rolled.judge(&direct.positions);
    let outcome = if through > 0 {
        Outcome::of(Some(format!("{through} positions behind walls")), rolled.said())
    } else {
        outcome
    };
    let title = format!("Block thrown at the wall at {speed} m/s");
    Ok(Case { error, outcome, picture: rolled.picture(title, &direct.positions, &direct) })
}

/// Predicts a block that is thrown at a wall.
///
/// # Errors
/// If a study's own scene or packing cannot be made; failures under study are results.
pub fn study(suite: Suite, simulator: &Simulator) -> Result<Study, StudyError> {
    let mut speeds = suite.pick(
        vec![1.0, 3.0, 10.0, 15.0, 30.0],
        vec![1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 15.0, 20.0, 25.0, 30.0],
    );
    let (mut cases, mut notes) = (Vec::new(), Vec::new());
    for &speed in &speeds {
        match run(simulator, speed) {
            Ok(case) => cases.push(case),
            // Discs have a limit of their own.
            Err(error) if !cases.is_empty() => {
                notes.push(format!("There is no truth from {speed} m/s on: {error}."));
                break;
            }
            Err(error) => return Err(error),
        }
    }
    speeds.truncate(cases.len());
    let interval = simulator.training.frame_interval;
    let radius = simulator.config.connection_radius;
    let stopped = cases.iter().map(|c| !c.outcome.text().contains("leaves the domain"));
    let refused = cases.iter().map(|c| &c.outcome).find(|o| o.text().contains("leaves the domain"));
    let works = speeds.iter().zip(&cases).map(|(&v, c)| (v, c.outcome.works()));
    let fails = cases.iter().map(|c| &c.outcome).find(|o| !o.works());
    let last = cases.last().map_or(Outcome::Stable, |c| c.outcome.clone());
    Ok(Study {
        method: format!(
            "A block of 0.5 m of {} is thrown at the left wall. Walls stop predicted points; one that is \
             more than a connection radius ({radius} m) behind a wall before it is stopped ends the \
             rollout. Failure: an error, points behind walls, or a prediction wrong by more than \
             {WRONG} of the motion.",
            Teacher::of(simulator).name()
        ),
        findings: vec![
            Finding {
                case: "impact on a wall".into(),
                parameter: "velocity, m/s".into(),
                measured: Threshold::of_sweep(works),
                theory: None,
                beyond: fails.cloned().unwrap_or(last.clone()),
            },
            Finding {
                case: "rollout ended at the wall".into(),
                parameter: "velocity, m/s".into(),
                measured: Threshold::of_sweep(speeds.iter().copied().zip(stopped)),
                theory: Some((radius / interval, "connection radius over interval".into())),
                beyond: refused.cloned().unwrap_or(last),
            },
        ],
        maps: vec![Map {
            title: "Impact on a wall".into(),
            x: Axis::new("velocity, m/s", speeds),
            y: Axis::named("scene", vec!["block".into()]),
            numbers: vec![cases.iter().map(|c| c.error).collect()],
            outcomes: vec![cases.iter().map(|c| c.outcome.clone()).collect()],
            caption: "Numbers: error over motion.".into(),
        }],
        pictures: cases
            .into_iter()
            .find(|c| !c.outcome.works())
            .map(|c| c.picture)
            .into_iter()
            .collect(),
        notes,
        ..Study::default()
    })
}
