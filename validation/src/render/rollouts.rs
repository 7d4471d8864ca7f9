//! Rollouts as tables, charts, pictures and animations.

use std::path::Path;

use dempm::trajectory::{Frame, Trajectory};
use plot::{Axis, Chart, Mark, Series};
use rayon::prelude::*;
use surrogate::evaluation::Errors;

use crate::difference::common_times;
use crate::render::animation::animated;
use crate::render::block::Block;
use crate::render::figure::{Figure, Picture};
use crate::render::overlay::{RANGE, View, in_rows};
use crate::render::table::Table;
use crate::studies::rollouts::Rollout;
use crate::studies::statistics::mean;
use crate::text::number;

/// More pictures would make the page large.
const MOST_PICTURES: usize = 30;
/// Pictures of a snapshot.
const SNAPSHOTS: usize = 4;
/// Width of an animation, pixels.
const ANIMATION_WIDTH: u32 = 400;

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
        "From frame: the first predicted frame; earlier ones are given. MSE: mean square distance of \
         points, box width 1, over all predicted frames. Front and height (root mean square over columns of \
         fixed width): differences at the end.",
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
        let mse: Vec<f64> = errors.iter().map(|e| e.mse).collect();
        table.row([
            rollout.case.clone(),
            rollout.model.clone(),
            rollout.first_frame(),
            number(mean(&mse)),
            number(peak.mse),
            frame.to_string(),
            number(last.mse),
            number(last.front),
            number(last.height),
            failure.as_deref().map_or("finished".to_owned(), early),
        ]);
    }
    table
}

/// When and why a rollout ended early, from the status of its trajectory without the numbers in
/// brackets.
fn early(status: &str) -> String {
    let why = status.strip_prefix("failed: ").unwrap_or(status);
    format!("early, {}", why.split(" (").next().unwrap_or(why))
}

/// Messages of the rollouts that ended early.
pub fn failures<'a>(rollouts: impl IntoIterator<Item = &'a Rollout>) -> Vec<Block> {
    let failed = rollouts.into_iter().filter(|rollout| !rollout.message.is_empty());
    failed
        .flat_map(|rollout| {
            let what = format!("{} on {} ended early:", rollout.model, rollout.case);
            [Block::Text(what), Block::Quote(rollout.message.clone())]
        })
        .collect()
}

/// Error over time, one line for each rollout. `floor` is the difference between two seeds.
///
/// # Errors
/// If the chart cannot be drawn.
pub fn chart(title: &str, rollouts: &[&Rollout], floor: Option<&Errors>) -> miette::Result<Block> {
    let points = |errors: &Errors| errors.errors.iter().map(|e| (e.time, e.mse)).collect();
    let name = |rollout: &Rollout| {
        let several_cases = rollouts.iter().any(|other| other.case != rollout.case);
        let one_model = rollouts.iter().all(|other| other.model == rollout.model);
        match (several_cases, one_model) {
            (true, true) => rollout.case.clone(),
            (true, false) => format!("{}, {}", rollout.model, rollout.case),
            (false, _) => rollout.model.clone(),
        }
    };
    let mut series: Vec<Series> =
        rollouts.iter().map(|r| Series::new(name(r), Mark::Line, points(&r.errors))).collect();
    if let Some(floor) = floor {
        series.push(Series::new("two seeds of the solver", Mark::Reference, points(floor)));
    }
    let svg =
        Chart { x: Axis::linear("time [s]"), y: Axis::log("MSE [box²]"), series, floor: None }
            .svg()?;
    let mut caption = "Mean square distance of points from the solver's, box width 1.".to_owned();
    if rollouts.iter().any(|rollout| rollout.errors.failure.is_some()) {
        caption += " A line that ends before the others is a rollout that ended early.";
    }
    Ok(Block::Figure(Figure::new(title, Picture::Svg(svg), caption)))
}

/// Snapshots of a rollout over the truth; `None` without a predicted frame.
///
/// # Errors
/// If a file cannot be read.
pub fn snapshots(rollout: &Rollout) -> miette::Result<Option<Block>> {
    if !rollout.output.exists() {
        return Ok(None);
    }
    let pairs = Pairs::read(&rollout.output, &rollout.truth, SNAPSHOTS)?;
    let view = pairs.view();
    let columns = if view.is_high() { 2 } else { 1 };
    let view = View { width: view.width / columns, ..view };
    let images: Vec<_> = pairs.pairs.iter().map(|(_, p, t)| view.draw(&p.position, t)).collect();
    let times: Vec<String> = pairs.pairs.iter().map(|(time, ..)| format!("{time:.2}")).collect();
    let caption = format!(
        "At {} s, row by row. Grey: the solver. Coloured: predicted points, by their squared distance \
         from the solver's (box width 1), from {:.0e} and below (dark blue) to {:.0e} and above (dark \
         red); each colour spans half a decade.",
        times.join(", "),
        RANGE[0],
        RANGE[1]
    );
    let title = format!("{} on {}", rollout.model, rollout.case);
    Ok(Some(Block::Figure(Figure::new(title, in_rows(&images, columns)?, caption))))
}

/// An animation of a rollout over the truth; `None` without a predicted frame.
///
/// # Errors
/// If a file cannot be read.
pub fn animation(rollout: &Rollout) -> miette::Result<Option<Figure>> {
    if rollout.is_refused() {
        return Ok(None);
    }
    let pairs = Pairs::read(&rollout.output, &rollout.truth, MOST_PICTURES)?;
    let title = format!("{} on {}, animated", rollout.model, rollout.case);
    let caption = "Grey: the solver. Coloured: predicted points, from blue (close to the solver) over \
                   yellow to red (far from it).";
    Ok(Some(Figure::new(title, pairs.animated()?, caption)))
}

/// An animation of a trajectory over another one of the same scene with as many points.
///
/// # Errors
/// If a file cannot be read.
pub fn animation_of_runs(
    title: &str,
    caption: &str,
    run: &Path,
    truth: &Path,
) -> miette::Result<Figure> {
    let pairs = Pairs::read(run, truth, MOST_PICTURES)?;
    Ok(Figure::new(title, pairs.animated()?, caption))
}

/// Frames of a prediction and of the truth at the same times (s).
struct Pairs {
    pairs: Vec<(f64, Frame, Frame)>,
    /// Distance of points, m.
    spacing: f64,
    /// Size of the domain, m.
    domain: [f64; 2],
}

impl Pairs {
    /// Up to `count` pairs, evenly spaced up to the last common time.
    fn read(predicted: &Path, truth: &Path, count: usize) -> miette::Result<Self> {
        let [predicted, truth] = [Trajectory::open(predicted)?, Trajectory::open(truth)?];
        let common = common_times(predicted.time(), truth.time());
        let mut pairs = Vec::new();
        for k in 1..=count.min(common.len()) {
            let (p, t) = common[k * common.len() / count.min(common.len()) - 1];
            pairs.push((truth.time()[t], predicted.frame(p)?, truth.frame(t)?));
        }
        let header = truth.header();
        Ok(Self { pairs, spacing: header.point_spacing, domain: header.domain })
    }

    fn view(&self) -> View {
        View::of(self.pairs.iter().flat_map(|(_, a, b)| [a, b]), self.spacing, self.domain)
    }

    fn animated(&self) -> miette::Result<Picture> {
        let view = View { width: ANIMATION_WIDTH, ..self.view() };
        let images: Vec<_> =
            self.pairs.par_iter().map(|(_, p, t)| view.draw(&p.position, t)).collect();
        Ok(animated(&images)?)
    }
}

#[cfg(test)]
mod tests {
    use surrogate::rollout::RolloutError;

    use super::*;

    #[test]
    fn why_a_rollout_ended_is_short() {
        let error = RolloutError::Crowded { frame: 9, neighbours: 155.0, plane: 50.0 };
        assert_eq!(
            early(&format!("failed: {error}")),
            "early, frame 9: points are pressed together"
        );
        assert_eq!(early("interrupted"), "early, interrupted");
    }
}
