//! Learned simulators beside the trajectories that they should reproduce.

use std::path::{Path, PathBuf};

use dempm::trajectory::Trajectory;
use surrogate::metrics::Errors;

use crate::block::{Block, Figure, Table};
use crate::chart::{Axis, Chart, Mark, Series};
use crate::compare::difference;
use crate::context::{Context, Model, Start};
use crate::picture::{RANGE, View, stacked};
use crate::table::number;

/// A rollout and how far it is from the truth.
pub struct Rollout {
    pub model: String,
    /// Stem of the truth's file.
    pub case: String,
    pub output: PathBuf,
    pub truth: PathBuf,
    /// As far as the rollout came.
    pub errors: Errors,
    /// Wall time of the prediction, s, and what it ran on.
    pub seconds: f64,
    pub device: String,
    /// What the program said if it broke down.
    pub message: String,
}

/// Rolls models out from the first frames of trajectories.
///
/// # Errors
/// If files cannot be read or the user interrupts. A rollout that breaks down is a result.
pub fn roll_out(
    context: &mut Context,
    models: &[Model],
    truths: &[PathBuf],
) -> miette::Result<Vec<Rollout>> {
    let mut rollouts = Vec::new();
    for truth in truths {
        for model in models {
            let run = context.rollout(model, &Start::Trajectory(truth))?;
            let mut rollout = Rollout {
                model: model.name.clone(),
                case: truth.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
                output: run.output.clone(),
                truth: truth.clone(),
                errors: Errors::default(),
                seconds: f64::NAN,
                device: String::new(),
                message: if run.succeeded { String::new() } else { run.message },
            };
            // A rollout that broke down leaves the frames before; one that was refused, nothing.
            if run.output.exists() {
                let trajectory = Trajectory::open(&run.output)?;
                rollout.errors = difference(&run.output, truth)?;
                rollout.seconds =
                    trajectory.wall_time().get("surrogate").copied().unwrap_or(f64::NAN);
                rollout.device.clone_from(&trajectory.header().device);
            }
            rollouts.push(rollout);
        }
    }
    Ok(rollouts)
}

/// Errors as a table.
pub fn table(rollouts: &[Rollout]) -> Table {
    let columns = [
        "case",
        "network",
        "mean MSE",
        "peak MSE",
        "at frame",
        "last MSE",
        "front [m]",
        "height [m]",
        "time [s]",
        "ended",
    ];
    let mut table = Table::new("Errors of rollouts", columns).note(
        "MSE in units of the box, over all points and frames after the first; front and root mean \
         square height at the end. Time of all predictions, the frames at the start not counted.",
    );
    for rollout in rollouts {
        let Errors { errors, failure, .. } = &rollout.errors;
        if errors.is_empty() {
            table.row([&rollout.case, &rollout.model, "", "", "", "", "", "", "", "refused"]);
            continue;
        }
        let (peak, frame) = rollout.errors.peak();
        let last = rollout.errors.last();
        let mean = errors.iter().map(|e| e.mse).sum::<f64>() / errors.len() as f64;
        table.row([
            rollout.case.clone(),
            rollout.model.clone(),
            number(mean),
            number(peak),
            frame.to_string(),
            number(last.mse),
            number(last.front),
            number(last.height),
            number(rollout.seconds),
            failure.as_ref().map_or("well", |_| "early").to_owned(),
        ]);
    }
    table
}

/// What programs said about rollouts that broke down.
pub fn failures(rollouts: &[Rollout]) -> Vec<Block> {
    let failed = rollouts.iter().filter(|rollout| !rollout.message.is_empty());
    failed
        .flat_map(|rollout| {
            let what = format!("{} on {} ended early:", rollout.model, rollout.case);
            [Block::Text(what), Block::Quote(rollout.message.clone())]
        })
        .collect()
}

/// Error over time, one line a rollout. `floor` is the difference between two seeds.
///
/// # Errors
/// If the chart cannot be drawn.
pub fn chart(title: &str, rollouts: &[&Rollout], floor: Option<&Errors>) -> miette::Result<Block> {
    let places = |errors: &Errors| errors.errors.iter().map(|e| (e.time, e.mse)).collect();
    let name = |rollout: &Rollout| {
        let several = rollouts.iter().any(|other| other.case != rollout.case);
        let one = rollouts.iter().all(|other| other.model == rollout.model);
        match (several, one) {
            (true, true) => rollout.case.clone(),
            (true, false) => format!("{}, {}", rollout.model, rollout.case),
            (false, _) => rollout.model.clone(),
        }
    };
    let mut series: Vec<Series> =
        rollouts.iter().map(|r| Series::new(name(r), Mark::Line, places(&r.errors))).collect();
    if let Some(floor) = floor {
        series.push(Series::new("two seeds of the truth", Mark::Reference, places(floor)));
    }
    let picture =
        Chart { x: Axis::linear("time [s]"), y: Axis::log("MSE [box²]"), series, floor: None }
            .draw()?;
    let caption = "Mean square distance of points from where they should be, in units of the box.";
    Ok(Block::Figure(Figure::new(title, picture, caption)))
}

/// Snapshots of a rollout over the truth.
///
/// # Errors
/// If a file cannot be read.
pub fn snapshots(rollout: &Rollout) -> miette::Result<Option<Block>> {
    let [predicted, truth] = [&rollout.output, &rollout.truth].map(|path: &PathBuf| path.as_path());
    if !predicted.exists() {
        return Ok(None);
    }
    let pairs = pairs(predicted, truth, 4)?;
    let truth = Trajectory::open(truth)?;
    let header = truth.header();
    let frames = pairs.iter().flat_map(|(_, a, b)| [a, b]);
    let view = View::of(frames, header.point_spacing, header.domain);
    let images: Vec<_> = pairs.iter().map(|(_, p, t)| view.draw(&p.position, t)).collect();
    let times: Vec<String> = pairs.iter().map(|(time, ..)| format!("{time:.2}")).collect();
    let caption = format!(
        "From top to bottom at {} s. Grey: the truth. Coloured: predicted points, by the square of \
         their distance from the truth in units of the box, logarithmically from {:.0e} (blue) over \
         yellow to {:.0e} (red).",
        times.join(", "),
        RANGE[0],
        RANGE[1]
    );
    let title = format!("{} on {}", rollout.model, rollout.case);
    Ok(Some(Block::Figure(Figure::new(title, stacked(&images)?, caption))))
}

/// Frames of two files at the same times, `count` of them evenly spaced up to the end.
fn pairs(
    predicted: &Path,
    truth: &Path,
    count: usize,
) -> miette::Result<Vec<(f64, dempm::trajectory::Frame, dempm::trajectory::Frame)>> {
    let [predicted, truth] = [Trajectory::open(predicted)?, Trajectory::open(truth)?];
    let common = crate::compare::common_times(predicted.time(), truth.time());
    let mut pairs = Vec::new();
    for k in 1..=count.min(common.len()) {
        let (p, t) = common[k * common.len() / count.min(common.len()) - 1];
        pairs.push((truth.time()[t], predicted.frame(p)?, truth.frame(t)?));
    }
    Ok(pairs)
}
