//! Columns taller, wider and faster than in training.

use surrogate::simulator::Simulator;

use super::super::outcome::Outcome;
use super::super::study::{Axis, Finding, Map, Picture, Study, StudyError, pick};
use super::super::threshold::Threshold;
use super::roll::{Direct, WRONG, column, roll, text};
use crate::context::Suite;
use crate::sections::paper::networks::trained_on;

struct Case {
    error: f64,
    outcome: Outcome,
    picture: Picture,
}

/// A column at the left wall, thrown to the right.
fn run(
    simulator: &Simulator,
    size: [f64; 2],
    speed: f64,
    frames: usize,
) -> Result<Case, StudyError> {
    let [width, height] = size;
    let domain = [(width + 3.0).max(4.0), (height + 0.5).max(2.0)];
    let name = format!("column of {width} x {height} m at {speed} m/s");
    let scene = text(domain, &column([0.0, 0.0], size, [speed, 0.0]));
    let interval = simulator.training.frame_interval;
    let direct = Direct::run(&name, &scene, interval, frames)?;
    let rolled = roll(simulator, &direct.start(simulator)?, frames);
    let (error, outcome) = rolled.judge(&direct.positions);
    let end = (rolled.positions.len() - 1) as f64 * interval;
    let picture = rolled.picture(format!("{name}, t = {end:.2} s"), &direct.positions, &direct);
    Ok(Case { error, outcome, picture })
}

pub fn study(suite: Suite, simulator: &Simulator) -> Result<Study, StudyError> {
    let duration = pick(suite, 0.5, 1.2);
    let frames = (duration / simulator.training.frame_interval).round() as usize + 1;
    let mut study = Study {
        method: format!(
            "Columns of the continuum law at the left wall, {duration} s: heights, widths and \
             initial velocities within and outside of those trained on ({}). Failure: an error, or a \
             prediction wrong by more than {WRONG} of the motion.",
            trained_on(&simulator.training)
        ),
        ..Study::default()
    };
    let heights = pick(suite, vec![0.5, 1.0, 2.0], vec![0.5, 1.0, 1.5, 2.0, 3.0]);
    let speeds = pick(suite, vec![0.0, 1.0, 2.5, 5.0], vec![0.0, 1.0, 2.5, 5.0, 7.5, 10.0]);
    let grid = |height: f64| -> Result<Vec<Case>, StudyError> {
        speeds.iter().map(|&v| run(simulator, [0.5, height], v, frames)).collect()
    };
    let rows: Vec<Vec<Case>> = heights.iter().map(|&h| grid(h)).collect::<Result<_, _>>()?;
    for (&height, row) in heights.iter().zip(&rows) {
        let works = speeds.iter().zip(row).map(|(&v, case)| (v, case.outcome.works()));
        study.findings.push(finding(format!("{height} m high"), "velocity, m/s", works, row));
    }
    study.maps.push(Map {
        title: "Height and initial velocity".into(),
        x: Axis::new("velocity, m/s", speeds.clone()),
        y: Axis::new("height, m", heights.clone()),
        numbers: rows.iter().map(|row| row.iter().map(|c| c.error).collect()).collect(),
        outcomes: rows.iter().map(|row| row.iter().map(|c| c.outcome.clone()).collect()).collect(),
        caption: "Columns 0.5 m wide. Numbers: error over motion.".into(),
    });

    let tall = pick(suite, vec![1.0, 3.0, 6.0], vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let wide = pick(suite, vec![0.25, 0.5, 1.0, 2.0], vec![0.25, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0]);
    let heights = tall.iter().map(|&h| run(simulator, [0.5, h], 0.0, frames));
    let heights: Vec<Case> = heights.collect::<Result<_, _>>()?;
    let widths = wide.iter().map(|&w| run(simulator, [w, 1.0], 0.0, frames));
    let widths: Vec<Case> = widths.collect::<Result<_, _>>()?;
    for (name, values, cases) in [("height, m", tall, heights), ("width, m", wide, widths)] {
        let works = values.iter().zip(&cases).map(|(&v, case)| (v, case.outcome.works()));
        study.findings.push(finding("at rest".into(), name, works, &cases));
        study.maps.push(Map {
            title: format!("Columns at rest: {name}"),
            x: Axis::new(name, values.clone()),
            y: Axis::named("", vec!["at rest".into()]),
            numbers: vec![cases.iter().map(|c| c.error).collect()],
            outcomes: vec![cases.iter().map(|c| c.outcome.clone()).collect()],
            caption: "Numbers: error over motion.".into(),
        });
        study.pictures.extend(cases.into_iter().next_back().map(|c| c.picture));
    }
    study.pictures.extend(
        rows.into_iter().next_back().and_then(|r| r.into_iter().next_back()).map(|c| c.picture),
    );
    Ok(study)
}

fn finding(
    case: String,
    parameter: &str,
    works: impl Iterator<Item = (f64, bool)>,
    cases: &[Case],
) -> Finding {
    let fails = cases.iter().map(|c| &c.outcome).find(|o| !o.works());
    let last = cases.last().map(|c| &c.outcome);
    Finding {
        case,
        parameter: parameter.into(),
        measured: Threshold::of_sweep(works),
        theory: None,
        beyond: fails.or(last).cloned().unwrap_or(Outcome::Stable),
    }
}
