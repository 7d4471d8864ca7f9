//! Learned simulators beside the trajectories that they should reproduce.

use std::path::{Path, PathBuf};

use dempm::trajectory::Trajectory;
use plot::{Axis, Chart, Mark, Series};
use rayon::prelude::*;
use surrogate::evaluation::Errors;

use crate::animation::animated;
use crate::block::{Block, Figure, Table};
use crate::compare::kept_difference;
use crate::context::{Context, Model, Start};
use crate::picture::{RANGE, View, in_rows};
use crate::table::number;
use crate::work::Run;

/// A rollout and how far it is from the truth.
pub struct Rollout {
    pub model: String,
    /// Name of the truth.
    pub case: String,
    pub output: PathBuf,
    pub truth: PathBuf,
    /// As far as the rollout came.
    pub errors: Errors,
    /// What the program said if it broke down.
    pub message: String,
}

impl Rollout {
    /// Whether there is nothing of it: it did not begin.
    pub fn is_refused(&self) -> bool {
        self.errors.errors.is_empty()
    }

    /// The first of the truth's frames that it predicts, as text.
    pub fn first_frame(&self) -> String {
        self.errors.frames.first().map_or(String::new(), usize::to_string)
    }
}

/// Rolls models out from the first frames of trajectories, which are given with their names.
///
/// # Errors
/// If files cannot be read or the user interrupts. A rollout that breaks down is a result.
pub fn roll_out(
    context: &mut Context,
    models: &[Model],
    truths: &[(String, PathBuf)],
) -> miette::Result<Vec<Rollout>> {
    let pairs = || truths.iter().flat_map(|truth| models.iter().map(move |model| (truth, model)));
    let keys: Vec<String> =
        pairs().map(|((_, truth), _)| context.hash(truth)).collect::<Result<_, _>>()?;
    let truths: Vec<&Path> = pairs().map(|((_, truth), _)| truth.as_path()).collect();
    let wanted: Vec<_> =
        pairs().map(|((_, truth), model)| (model, Start::Trajectory(truth))).collect();
    let runs = context.rollouts(&wanted, |place, run| {
        // Others are still under way. What goes wrong here does so again below.
        let _ = errors(run, truths[place], &keys[place]);
    })?;
    let all = pairs().zip(runs).zip(&keys);
    all.map(|((((case, truth), model), run), key)| compare(model, case, truth, run, key)).collect()
}

/// Errors of a rollout. One that broke down leaves the frames before; one that was refused, nothing.
fn errors(run: &Run, truth: &Path, key: &str) -> miette::Result<Errors> {
    if !run.output.exists() {
        return Ok(Errors::default());
    }
    Ok(predicted(kept_difference(run, truth, key)?))
}

fn compare(
    model: &Model,
    case: &str,
    truth: &Path,
    run: Run,
    key: &str,
) -> miette::Result<Rollout> {
    let errors = errors(&run, truth, key)?;
    Ok(Rollout {
        model: model.name.clone(),
        case: case.to_owned(),
        output: run.output,
        truth: truth.to_owned(),
        errors,
        message: if run.succeeded { String::new() } else { run.message },
    })
}

/// Errors without those of the frames that were given, which agree exactly.
fn predicted(mut errors: Errors) -> Errors {
    let given = errors.errors.iter().take_while(|error| error.mse == 0.0).count();
    errors.errors.drain(..given);
    errors.frames.drain(..given);
    errors
}

/// Errors as a table.
pub fn table(rollouts: &[Rollout]) -> Table {
    let columns = [
        "case",
        "network",
        "from frame",
        "mean MSE",
        "peak MSE",
        "at frame",
        "last MSE",
        "front [m]",
        "height [m]",
        "ended",
    ];
    let mut table = Table::new("Errors of rollouts", columns).note(
        "From frame: the first of the truth's frames that is predicted; those before are given. MSE in \
         units of the box, over all points and predicted frames; front and root mean square height at \
         the end.",
    );
    for rollout in rollouts {
        let Errors { errors, failure, .. } = &rollout.errors;
        let (Some((peak, frame)), Some(last)) = (rollout.errors.peak(), rollout.errors.last())
        else {
            let nothing = [""; 7];
            let named = [rollout.case.as_str(), &rollout.model].into_iter();
            table.row(named.chain(nothing).chain(["refused"]));
            continue;
        };
        let mean = errors.iter().map(|e| e.mse).sum::<f64>() / errors.len() as f64;
        table.row([
            rollout.case.clone(),
            rollout.model.clone(),
            rollout.first_frame(),
            number(mean),
            number(peak),
            frame.to_string(),
            number(last.mse),
            number(last.front),
            number(last.height),
            failure.as_deref().map_or("well".to_owned(), early),
        ]);
    }
    table
}

/// When and why a rollout ended, from the state of its trajectory, which has numbers in brackets.
fn early(state: &str) -> String {
    let why = state.strip_prefix("failed: ").unwrap_or(state);
    format!("early, {}", why.split(" (").next().unwrap_or(why))
}

/// What programs said about rollouts that broke down.
pub fn failures<'a>(rollouts: impl IntoIterator<Item = &'a Rollout>) -> Vec<Block> {
    let failed = rollouts.into_iter().filter(|rollout| !rollout.message.is_empty());
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
            .svg()
            .map(crate::figure::Picture::Svg)?;
    let mut caption =
        "Mean square distance of points from where they should be, in units of the box.".to_owned();
    if rollouts.iter().any(|rollout| rollout.errors.failure.is_some()) {
        caption += " Where a line ends before the others, the rollout did.";
    }
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
    let columns = if view.is_high() { 2 } else { 1 };
    let view = View { width: view.width / columns, ..view };
    let images: Vec<_> = pairs.iter().map(|(_, p, t)| view.draw(&p.position, t)).collect();
    let times: Vec<String> = pairs.iter().map(|(time, ..)| format!("{time:.2}")).collect();
    let caption = format!(
        "At {} s, from left to right and from top to bottom. Grey: the truth. Coloured: predicted points, by the square of \
         their distance from the truth in units of the box: a colour for each half of a decade from \
         {:.0e} (dark blue) over yellow to {:.0e} and more (dark red).",
        times.join(", "),
        RANGE[0],
        RANGE[1]
    );
    let title = format!("{} on {}", rollout.model, rollout.case);
    Ok(Some(Block::Figure(Figure::new(title, in_rows(&images, columns)?, caption))))
}

/// The same as an animation of all frames, or of every n-th where there are many.
///
/// # Errors
/// If a file cannot be read.
pub fn animation(rollout: &Rollout) -> miette::Result<Option<Block>> {
    if rollout.errors.errors.is_empty() {
        return Ok(None);
    }
    let pairs = pairs(&rollout.output, &rollout.truth, MOST_PICTURES)?;
    let truth = Trajectory::open(&rollout.truth)?;
    let header = truth.header();
    let frames = pairs.iter().flat_map(|(_, a, b)| [a, b]);
    let view = View { width: 400, ..View::of(frames, header.point_spacing, header.domain) };
    let images: Vec<_> = pairs.par_iter().map(|(_, p, t)| view.draw(&p.position, t)).collect();
    let title = format!("{} on {}, animated", rollout.model, rollout.case);
    let caption = "Colours as in the snapshots.";
    Ok(Some(Block::Figure(Figure::new(title, animated(&images)?, caption))))
}

/// An animation of more pictures would make the page heavy.
const MOST_PICTURES: usize = 30;

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

#[cfg(test)]
mod tests {
    use super::*;
    use surrogate::evaluation::FrameError;
    use surrogate::rollout::RolloutError;

    impl Rollout {
        /// With these errors, a tenth of a second apart.
        pub fn of_errors(model: &str, mse: &[f64], failure: Option<&str>) -> Self {
            let error = |(k, &mse): (usize, &f64)| FrameError {
                time: 0.1 * k as f64,
                mse,
                ..FrameError::default()
            };
            let errors = Errors {
                errors: mse.iter().enumerate().map(error).collect(),
                failure: failure.map(str::to_owned),
                ..Errors::default()
            };
            let [output, truth] = [PathBuf::new(), PathBuf::new()];
            let (model, case, message) = (model.to_owned(), String::new(), String::new());
            Self { model, case, output, truth, errors, message }
        }
    }

    #[test]
    fn why_a_rollout_ended_is_short() {
        let error = RolloutError::Crowded { frame: 9, neighbours: 155.0, plane: 50.0 };
        assert_eq!(
            early(&format!("failed: {error}")),
            "early, frame 9: points are pressed together"
        );
        assert_eq!(early("interrupted"), "early, interrupted");
    }

    #[test]
    fn given_frames_do_not_count() {
        let error = |mse| FrameError { mse, ..FrameError::default() };
        let errors = Errors {
            frames: vec![1, 2, 3, 4],
            errors: [0.0, 0.0, 1e-6, 0.0].map(error).to_vec(),
            ..Errors::default()
        };
        let predicted = predicted(errors);
        assert_eq!(predicted.frames, [3, 4]);
        assert_eq!(predicted.mean(), 5e-7);
    }
}
