//! Noise on the initial frames, mirror images, and frames of another rate.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surrogate::diagnostics::{asymmetry, mirror_image};
use surrogate::rollout::{InitialFrames, stride};
use surrogate::simulator::Simulator;

use super::rollout::{Direct, Frames, Rolled, Teacher, WRONG, column, difference, roll};
use crate::studies::stability::outcome::Outcome;
use crate::studies::stability::study::{
    Axis, Chart, Curve, Finding, Map, Picture, Study, StudyError,
};
use crate::studies::stability::threshold::{Threshold, log_range};
use crate::suite::Suite;

const DOMAIN: [f64; 2] = [4.0, 2.0];
const SEED: u64 = 1;
/// Mirror images that part by more than this part of the motion are no mirror images.
const ASYMMETRY: f64 = 0.1;

/// The same frames with independent noise on every position (m), uniform with this standard
/// deviation.
fn noisy(mut start: InitialFrames, deviation: f64) -> InitialFrames {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let half = deviation * 3.0_f64.sqrt();
    for x in start.positions.iter_mut().flatten().flatten() {
        *x += rng.random_range(-half..=half);
    }
    start
}

/// Left and right exchanged.
fn mirrored(frames: &Frames) -> Frames {
    let of_point = |x: &[f64; 2]| [DOMAIN[0] - x[0], x[1]];
    frames.iter().map(|frame| frame.iter().map(of_point).collect()).collect()
}

/// Predicts from noisy and from mirrored frames, and from frames of other intervals.
///
/// # Errors
/// If a study's own scene or packing cannot be made; failures under study are results.
pub fn study(suite: Suite, simulator: &Simulator) -> Result<Study, StudyError> {
    let (teacher, interval) = (Teacher::of(simulator), simulator.training.frame_interval);
    let duration = suite.pick(0.5, 1.2);
    let frames = (duration / interval).round() as usize + 1;
    let free = column([1.0, 0.0], [0.75, 0.75], [0.0, 0.0]);
    let direct = teacher.run("column", DOMAIN, &free, frames)?;
    let mut study = Study {
        method: format!(
            "A column of 0.75 m of {} collapses for {duration} s. Noise is independent in every given \
             frame and point, so that velocities between those are disturbed by 1.4 times as much per frame. Failure: an \
             error, or a prediction wrong by more than {WRONG} of the motion. Mirror images should \
             move as mirror images: gravity is symmetric. A model only takes frames of its own \
             interval.",
            teacher.name()
        ),
        ..Study::default()
    };
    noise(suite, simulator, &direct, frames, &mut study)?;
    let wall = column([0.0, 0.0], [0.75, 0.75], [0.0, 0.0]);
    let wall = teacher.run("column at a wall", DOMAIN, &wall, frames)?;
    mirror(simulator, [("free", &direct), ("at the wall", &wall)], frames, &mut study)?;
    intervals(interval, &mut study);
    Ok(study)
}

fn noise(
    suite: Suite,
    simulator: &Simulator,
    direct: &Direct,
    frames: usize,
    study: &mut Study,
) -> Result<(), StudyError> {
    let deviations = log_range(1.0e-5, 1.0e-1, suite.pick(5, 13));
    let cases: Vec<(f64, Outcome, Picture)> = deviations
        .iter()
        .map(|&deviation| {
            let start = noisy(direct.start(simulator)?, deviation);
            let rolled = roll(simulator, &start, frames);
            let (error, outcome) = rolled.judge(&direct.positions);
            let title = format!("Rollout from frames with noise of {deviation:.0e} m");
            Ok((error, outcome, rolled.picture(title, &direct.positions, direct)))
        })
        .collect::<Result<_, StudyError>>()?;
    let works = deviations.iter().zip(&cases).map(|(&d, (_, o, _))| (d, o.works()));
    study.findings.push(Finding {
        case: "noise on the initial frames".into(),
        parameter: "standard deviation, m".into(),
        measured: Threshold::of_sweep(works),
        theory: None,
        beyond: Outcome::first_failure(cases.iter().map(|(_, o, _)| o)),
    });
    study.maps.push(Map {
        title: "Noise on the initial frames".into(),
        x: Axis::new("standard deviation, m", deviations),
        y: Axis::named("scene", vec!["column collapse".into()]),
        numbers: vec![cases.iter().map(|(e, ..)| *e).collect()],
        outcomes: vec![cases.iter().map(|(_, o, _)| o.clone()).collect()],
        caption: "Numbers: error over motion.".into(),
    });
    study.pictures.extend(cases.into_iter().find(|(_, o, _)| !o.works()).map(|(.., p)| p));
    Ok(())
}

/// The rollout of a start, and that of its mirror image, mirrored back.
fn images(
    simulator: &Simulator,
    direct: &Direct,
    frames: usize,
) -> Result<[Rolled; 2], StudyError> {
    let start = direct.start(simulator)?;
    let mut reflected = roll(simulator, &mirror_image(&start), frames);
    reflected.positions = mirrored(&reflected.positions);
    Ok([roll(simulator, &start, frames), reflected])
}

fn mirror(
    simulator: &Simulator,
    columns: [(&str, &Direct); 2],
    frames: usize,
    study: &mut Study,
) -> Result<(), StudyError> {
    let interval = simulator.training.frame_interval;
    let averaging = Simulator { mirror: true, ..simulator.clone() };
    let predictions = [("rollout", simulator), ("with --mirror", &averaging)];
    let (mut curves, mut rows) = (Vec::new(), Vec::new());
    for (column, direct) in columns {
        let mut row = Vec::new();
        for (prediction, simulator) in predictions {
            let [straight, reflected] = images(simulator, direct, frames)?;
            let both = straight.positions.len().min(reflected.positions.len());
            let apart = |k: usize| {
                let motion = difference(&straight.positions[k], &straight.positions[0]);
                difference(&straight.positions[k], &reflected.positions[k]) / motion
            };
            let points = (simulator.first_frames()..both).map(|k| [k as f64 * interval, apart(k)]);
            curves.push(Curve::measured(format!("{column}, {prediction}"), points.collect()));
            let last = apart(both - 1);
            let symptom = format!("mirror images part by {:.0} % of the motion", 100.0 * last);
            // What a rollout of this start says, of mirror images first.
            let of_images = asymmetry(simulator, &direct.start(simulator)?);
            let said: Vec<String> = of_images.into_iter().chain(straight.said()).collect();
            let said = (!said.is_empty()).then(|| said.join("; "));
            let outcome = Outcome::of((last > ASYMMETRY).then_some(symptom), said);
            row.push((last, outcome.clone()));
            study.findings.push(Finding {
                case: format!("mirror asymmetry at the end, column {column}, {prediction}"),
                parameter: "difference over motion".into(),
                measured: Threshold::Between(last, last),
                theory: Some((0.0, "gravity is symmetric".into())),
                beyond: outcome,
            });
            if !simulator.mirror {
                let picture = straight.picture(String::new(), &reflected.positions, direct);
                study.pictures.push(Picture {
                    title: format!("Mirror asymmetry at the end, column {column}"),
                    colour: "distance from the mirror image, m".into(),
                    reference: Vec::new(),
                    ..picture
                });
            }
        }
        rows.push(row);
    }
    let each = |row: &Vec<(f64, Outcome)>| row.iter().map(|(apart, _)| *apart).collect();
    study.maps.push(Map {
        title: "Mirror asymmetry at the end".into(),
        x: Axis::named("prediction", predictions.map(|(name, _)| name.to_owned()).into()),
        y: Axis::named("column", columns.map(|(name, _)| name.to_owned()).into()),
        numbers: rows.iter().map(each).collect(),
        outcomes: rows.into_iter().map(|row| row.into_iter().map(|(_, o)| o).collect()).collect(),
        caption: "Numbers: difference of mirror images over motion.".into(),
    });
    study.charts.push(Chart {
        title: "Mirror asymmetry".into(),
        x: "time, s".into(),
        y: "difference of mirror images over motion".into(),
        log: [false, true],
        curves,
        caption: "The rollout of the mirrored start, mirrored back, against the rollout itself."
            .into(),
    });
    Ok(())
}

/// Frames of another interval are refused, unless they divide the model's.
fn intervals(interval: f64, study: &mut Study) {
    let all = [0.5, 1.0, 2.0, 3.0, 6.0, 10.0].map(|k| k * interval);
    let outcomes = all.map(|found| match stride(interval, found, || "trajectory.h5".into()) {
        Ok(_) => Outcome::Stable,
        Err(error) => Outcome::Failed { message: error.to_string() },
    });
    study.findings.push(Finding {
        case: "frames coarser than the model's".into(),
        parameter: "interval, s".into(),
        measured: Threshold::of_sweep(all.into_iter().zip(outcomes.iter().map(Outcome::works))),
        theory: Some((interval, "interval of the training".into())),
        beyond: outcomes.iter().find(|o| !o.works()).cloned().unwrap_or(Outcome::Stable),
    });
    study.maps.push(Map {
        title: "Frames of another interval".into(),
        x: Axis::new("interval, s", all.into()),
        y: Axis::named("start", vec!["a trajectory".into()]),
        numbers: Vec::new(),
        outcomes: vec![outcomes.into()],
        caption: "A model takes frames of its own interval, or every n-th of finer ones.".into(),
    });
}
