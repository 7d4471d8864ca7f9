//! Beds at rest, and a plate pushed into one.

use surrogate::simulator::Simulator;

use super::rollout::{Direct, Teacher, WRONG, column, difference, roll};
use crate::studies::stability::outcome::Outcome;
use crate::studies::stability::study::{Axis, Finding, Map, Picture, Study, StudyError};
use crate::studies::stability::threshold::Threshold;
use crate::suite::Suite;

/// A bed that moves faster than this (m/s) more than the teacher's does is not at rest.
const CREEP: f64 = 0.01;
/// Width and depth of the bed (m), and of the plate.
const BED: [f64; 2] = [2.0, 0.5];
const PLATE: f64 = 0.5;

struct Case {
    number: f64,
    outcome: Outcome,
    picture: Picture,
}

/// A bed between walls that carries its own weight.
fn bed(teacher: &Teacher, depth: f64, frames: usize) -> Result<Direct, StudyError> {
    let bed = column([0.0, 0.0], [BED[0], depth], [0.0, 0.0]);
    teacher.run("bed", [BED[0], 2.0], &bed, frames)
}

/// Its mean speed (m/s).
fn rest(simulator: &Simulator, depth: f64, direct: &Direct) -> Result<Case, StudyError> {
    let (interval, frames) = (simulator.training.frame_interval, direct.positions.len());
    let rolled = roll(simulator, &direct.start(simulator)?, frames);
    let last = rolled.positions.len() - 1;
    let speed = |frames: &super::rollout::Frames| {
        difference(&frames[last], &frames[0]) / (last as f64 * interval)
    };
    let number = speed(&rolled.positions);
    let symptom = (number > CREEP + speed(&direct.positions))
        .then(|| format!("creeps at {:.0} mm/s", 1e3 * number))
        .or(rolled.error.clone());
    let picture = rolled.picture(
        format!("Bed of {depth} m at rest, t = {:.2} s", last as f64 * interval),
        &direct.positions,
        direct,
    );
    Ok(Case { number, outcome: Outcome::of(symptom, rolled.said()), picture })
}

/// A plate pushed 0.25 m deep into the bed, once `given` frames are over.
fn pushed(teacher: &Teacher, speed: f64, given: usize) -> Result<Direct, StudyError> {
    let frames = given + (0.25 / speed / teacher.interval).round() as usize;
    let start = (given - 1) as f64 * teacher.interval;
    let plate = format!(
        "[plate]\ncorner = [{:?}, {:?}]\nsize = [{PLATE}, 0.5]\nvelocity = [0.0, {:?}]\n\
         start = {start:?}\nfaces = {{ left = \"slip\", right = \"slip\", bottom = 0.5, top = 0.5 }}\n",
        0.5 * (BED[0] - PLATE),
        BED[1],
        -speed
    );
    let bed = column([0.0, 0.0], BED, [0.0, 0.0]);
    teacher.run("plate", [BED[0], 2.0], &(bed + &plate), frames)
}

/// Error over motion.
fn push(simulator: &Simulator, speed: f64, direct: &Direct) -> Result<Case, StudyError> {
    let rolled = roll(simulator, &direct.start(simulator)?, direct.positions.len());
    let (number, outcome) = rolled.judge(&direct.positions);
    let picture =
        rolled.picture(format!("Plate pushed in at {speed} m/s"), &direct.positions, direct);
    Ok(Case { number, outcome, picture })
}

/// Predicts beds at rest and a plate that is pushed into one.
///
/// # Errors
/// If a study's own scene or packing cannot be made; failures under study are results.
pub fn study(suite: Suite, simulator: &Simulator) -> Result<Study, StudyError> {
    let teacher = Teacher::of(simulator);
    let frames = (suite.pick(0.5, 2.0) / teacher.interval) as usize + 1;
    let depths = suite.pick(vec![0.25, 0.5, 1.0], vec![0.125, 0.25, 0.5, 1.0, 1.5]);
    let speeds = suite.pick(vec![5.0, 1.0, 0.5], vec![5.0, 2.0, 1.0, 0.5, 0.2, 0.1]);
    let given = simulator.first_frames();
    let still = teacher.runs(&depths, |&depth| bed(&teacher, depth, frames))?;
    let moved = teacher.runs(&speeds, |&speed| pushed(&teacher, speed, given))?;
    let beds = depths.iter().zip(&still).map(|(&depth, direct)| rest(simulator, depth, direct));
    let beds: Vec<Case> = beds.collect::<Result<_, _>>()?;
    let plates = speeds.iter().zip(&moved).map(|(&speed, direct)| push(simulator, speed, direct));
    let plates: Vec<Case> = plates.collect::<Result<_, _>>()?;
    let finding = |case: &str, parameter: &str, values: &[f64], cases: &[Case]| Finding {
        case: case.into(),
        parameter: parameter.into(),
        measured: Threshold::of_sweep(
            values.iter().zip(cases).map(|(&v, c)| (v, c.outcome.works())),
        ),
        theory: None,
        beyond: Outcome::first_failure(cases.iter().map(|c| &c.outcome)),
    };
    let map = |title: &str, label: &str, values: &[f64], cases: &[Case], caption: &str| Map {
        title: title.into(),
        x: Axis::new(label, values.to_vec()),
        y: Axis::named("scene", vec!["bed".into()]),
        numbers: vec![cases.iter().map(|c| c.number).collect()],
        outcomes: vec![cases.iter().map(|c| c.outcome.clone()).collect()],
        caption: caption.into(),
    };
    Ok(Study {
        method: format!(
            "Beds 2 m wide between walls, of {}. At rest nothing should move: failure is a mean speed \
             more than {:.0} mm/s above theirs. A plate of {PLATE} m is pushed 0.25 m deep, from fast \
             to slow, since a model sees velocities and slow motion drowns in its noise: failure is a \
             prediction wrong by more than {WRONG} of the motion.",
            teacher.name(),
            1e3 * CREEP
        ),
        findings: vec![
            finding("bed at rest", "depth, m", &depths, &beds),
            finding("penetration", "velocity of the plate, m/s, at least", &speeds, &plates),
        ],
        maps: vec![
            map("Bed at rest", "depth, m", &depths, &beds, "Numbers: mean speed, m/s."),
            map(
                "Penetration",
                "velocity of the plate, m/s",
                &speeds,
                &plates,
                "Numbers: error over motion.",
            ),
        ],
        pictures: [beds, plates]
            .into_iter()
            .filter_map(|cases| cases.into_iter().find(|c| !c.outcome.works()).map(|c| c.picture))
            .collect(),
        ..Study::default()
    })
}
