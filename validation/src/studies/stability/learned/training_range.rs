//! Columns taller, wider and faster than in training.

use surrogate::simulator::Simulator;

use super::rollout::{Direct, Teacher, WRONG, column, roll};
use crate::models::trained_on;
use crate::studies::stability::outcome::Outcome;
use crate::studies::stability::study::{Axis, Finding, Map, Picture, Study, StudyError};
use crate::studies::stability::threshold::Threshold;
use crate::suite::Suite;

struct Case {
    error: f64,
    outcome: Outcome,
    picture: Picture,
}

/// A column at the left wall, thrown to the right.
struct Throw {
    /// Width and height, m.
    size: [f64; 2],
    /// Initial velocity, m/s.
    speed: f64,
}

impl Throw {
    fn name(&self) -> String {
        let ([width, height], speed) = (self.size, self.speed);
        format!("column of {width} x {height} m at {speed} m/s")
    }

    fn simulate(&self, teacher: &Teacher, frames: usize) -> Result<Direct, StudyError> {
        let [width, height] = self.size;
        let domain = [(width + 3.0).max(4.0), (height + 0.5).max(2.0)];
        let column = column([0.0, 0.0], self.size, [self.speed, 0.0]);
        teacher.run(&self.name(), domain, &column, frames)
    }

    fn predict(&self, simulator: &Simulator, direct: &Direct) -> Result<Case, StudyError> {
        let rolled = roll(simulator, &direct.start(simulator)?, direct.positions.len());
        let (error, outcome) = rolled.judge(&direct.positions);
        let end = (rolled.positions.len() - 1) as f64 * simulator.training.frame_interval;
        let title = format!("{}, t = {end:.2} s", self.name());
        Ok(Case { error, outcome, picture: rolled.picture(title, &direct.positions, direct) })
    }
}

/// Predictions of what the teacher computes.
fn cases(simulator: &Simulator, throws: &[Throw], frames: usize) -> Result<Vec<Case>, StudyError> {
    let teacher = Teacher::of(simulator);
    let directs = teacher.runs(throws, |throw| throw.simulate(&teacher, frames))?;
    throws.iter().zip(&directs).map(|(throw, direct)| throw.predict(simulator, direct)).collect()
}

/// Predicts columns within and outside the range of the training data.
///
/// # Errors
/// If a study's own scene or packing cannot be made; failures under study are results.
pub fn study(suite: Suite, simulator: &Simulator) -> Result<Study, StudyError> {
    let duration = suite.pick(0.5, 1.2);
    let frames = (duration / simulator.training.frame_interval).round() as usize + 1;
    let mut study = Study {
        method: format!(
            "Columns of {} at the left wall, {duration} s: heights, widths and \
             initial velocities within and outside of those trained on ({}). Failure: an error, or a \
             prediction wrong by more than {WRONG} of the motion.",
            Teacher::of(simulator).name(),
            trained_on(&simulator.training)
        ),
        ..Study::default()
    };
    let heights = suite.pick(vec![0.5, 1.0, 2.0], vec![0.5, 1.0, 1.5, 2.0, 3.0]);
    let speeds = suite.pick(vec![0.0, 1.0, 2.5, 5.0], vec![0.0, 1.0, 2.5, 5.0, 7.5, 10.0]);
    let tall = suite.pick(vec![1.0, 3.0, 6.0], vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let wide = suite.pick(vec![0.25, 0.5, 1.0, 2.0], vec![0.25, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0]);
    let thrown = heights.iter().flat_map(|&h| speeds.iter().map(move |&v| ([0.5, h], v)));
    let higher = tall.iter().map(|&h| ([0.5, h], 0.0));
    let wider = wide.iter().map(|&w| ([w, 1.0], 0.0));
    let all = thrown.chain(higher).chain(wider).map(|(size, speed)| Throw { size, speed });
    let mut rows = cases(simulator, &all.collect::<Vec<_>>(), frames)?;
    let widths = rows.split_off(rows.len() - wide.len());
    let high = rows.split_off(rows.len() - tall.len());
    let rows: Vec<&[Case]> = rows.chunks(speeds.len()).collect();
    for (&height, &row) in heights.iter().zip(&rows) {
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

    for (name, values, cases) in [("height, m", tall, &high), ("width, m", wide, &widths)] {
        let works = values.iter().zip(cases).map(|(&v, case)| (v, case.outcome.works()));
        study.findings.push(finding("at rest".into(), name, works, cases));
        study.maps.push(Map {
            title: format!("Columns at rest: {name}"),
            x: Axis::new(name, values.clone()),
            y: Axis::named("", vec!["at rest".into()]),
            numbers: vec![cases.iter().map(|c| c.error).collect()],
            outcomes: vec![cases.iter().map(|c| c.outcome.clone()).collect()],
            caption: "Numbers: error over motion.".into(),
        });
        study.pictures.extend(cases.last().map(|c| c.picture.clone()));
    }
    let hardest = rows.last().and_then(|row| row.last());
    study.pictures.extend(hardest.map(|c| c.picture.clone()));
    Ok(study)
}

fn finding(
    case: String,
    parameter: &str,
    works: impl Iterator<Item = (f64, bool)>,
    cases: &[Case],
) -> Finding {
    Finding {
        case,
        parameter: parameter.into(),
        measured: Threshold::of_sweep(works),
        theory: None,
        beyond: Outcome::first_failure(cases.iter().map(|c| &c.outcome)),
    }
}
