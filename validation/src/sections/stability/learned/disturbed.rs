//! Noise on the initial frames, mirror images, and frames of another rate.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surrogate::simulator::Simulator;
use surrogate::start::{Start, stride};

use super::super::outcome::Outcome;
use super::super::study::{Axis, Chart, Curve, Finding, Map, Picture, Study, StudyError, pick};
use super::super::threshold::{Threshold, log_range};
use super::roll::{Direct, Frames, WRONG, column, difference, roll, text};
use crate::context::Suite;

const DOMAIN: [f64; 2] = [4.0, 2.0];
const SEED: u64 = 1;

/// The same frames with independent noise on every position (m), uniform with this standard
/// deviation.
fn noisy(start: &Start, deviation: f64) -> Start {
    let mut start = start.clone();
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

pub fn study(suite: Suite, simulator: &Simulator) -> Result<Study, StudyError> {
    let interval = simulator.training.frame_interval;
    let duration = pick(suite, 0.5, 1.2);
    let frames = (duration / interval).round() as usize + 1;
    let scene = text(DOMAIN, &column([1.0, 0.0], [0.75, 0.75], [0.0, 0.0]));
    let direct = Direct::run("column", &scene, interval, frames)?;
    let mut study = Study {
        method: format!(
            "A column of 0.75 m collapses for {duration} s. Noise is independent in every frame and \
             point, so that velocities are disturbed by 1.4 times as much per frame. Failure: an \
             error, or a prediction wrong by more than {WRONG} of the motion. Mirror images should \
             move as mirror images: gravity is symmetric. A model only takes frames of its own \
             interval."
        ),
        ..Study::default()
    };
    let start = direct.start(simulator)?;
    noise(suite, simulator, (&direct, &start), frames, &mut study);
    mirror(simulator, &start, frames, &mut study);
    study.findings.push(intervals(interval));
    Ok(study)
}

fn noise(
    suite: Suite,
    simulator: &Simulator,
    (direct, start): (&Direct, &Start),
    frames: usize,
    study: &mut Study,
) {
    let deviations = log_range(1.0e-5, 1.0e-1, pick(suite, 5, 13));
    let cases: Vec<(f64, Outcome, Picture)> = deviations
        .iter()
        .map(|&deviation| {
            let start = noisy(start, deviation);
            let rolled = roll(simulator, &start, frames);
            let (error, outcome) = rolled.judge(&direct.positions);
            let title = format!("Rollout from frames with noise of {deviation:.0e} m");
            (error, outcome, rolled.picture(title, &direct.positions, direct))
        })
        .collect();
    let works = deviations.iter().zip(&cases).map(|(&d, (_, o, _))| (d, o.works()));
    let fails = cases.iter().map(|(_, o, _)| o).find(|o| !o.works());
    study.findings.push(Finding {
        case: "noise on the initial frames".into(),
        parameter: "standard deviation, m".into(),
        measured: Threshold::of_sweep(works),
        theory: None,
        beyond: fails.or(cases.last().map(|(_, o, _)| o)).cloned().unwrap_or(Outcome::Stable),
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
}

fn mirror(simulator: &Simulator, start: &Start, frames: usize, study: &mut Study) {
    let image = Start { positions: mirrored(&start.positions), ..start.clone() };
    let straight = roll(simulator, start, frames);
    let reflected = roll(simulator, &image, frames);
    let back = mirrored(&reflected.positions);
    let interval = simulator.training.frame_interval;
    let both = straight.positions.len().min(back.len());
    let points: Vec<[f64; 2]> = (simulator.config.frames..both)
        .map(|k| {
            let motion = difference(&straight.positions[k], &straight.positions[0]);
            [k as f64 * interval, difference(&straight.positions[k], &back[k]) / motion]
        })
        .collect();
    let last = points.last().map_or(f64::NAN, |p| p[1]);
    let said = straight.said().or(reflected.said());
    let symptom = format!("mirror images part by {:.0} % of the motion", 100.0 * last);
    study.findings.push(Finding {
        case: "mirror asymmetry at the end".into(),
        parameter: "difference over motion".into(),
        measured: Threshold::Between(last, last),
        theory: Some((0.0, "gravity is symmetric".into())),
        beyond: Outcome::of((last > 0.1).then_some(symptom), said),
    });
    study.charts.push(Chart {
        title: "Mirror asymmetry".into(),
        x: "time, s".into(),
        y: "difference of mirror images over motion".into(),
        log: [false, true],
        curves: vec![Curve::measured("rollout", points)],
        caption: "The rollout of the mirrored start, mirrored back, against the rollout itself."
            .into(),
    });
}

/// Frames of another interval are refused, unless they divide the model's.
fn intervals(interval: f64) -> Finding {
    let coarse = [1.0, 2.0, 3.0, 6.0, 10.0];
    let refused = |k: f64| stride(interval, k * interval, || "trajectory.h5".into()).err();
    let works = coarse.map(|k| (k * interval, refused(k).is_none()));
    let said = coarse.iter().find_map(|&k| refused(k)).map(|e| e.to_string());
    Finding {
        case: "frames coarser than the model's".into(),
        parameter: "interval, s".into(),
        measured: Threshold::of_sweep(works),
        theory: Some((interval, "interval of the training".into())),
        beyond: Outcome::of(said.clone().map(|_| "refused".into()), said),
    }
}
