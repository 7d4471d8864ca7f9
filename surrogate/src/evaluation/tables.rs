//! Results of an evaluation as tables and a chart.

use std::fmt::Write as _;

use files::csv_cell;
use plot::{Axis, Chart, Mark, Series};
use serde::Serialize;

use super::compare::Case;
use super::metrics::{Errors, FrameError};

/// Each rollout, followed by its noise floor.
fn all(cases: &[Case]) -> impl Iterator<Item = &Errors> {
    cases.iter().flat_map(|case| [Some(&case.rollout), case.floor.as_ref()]).flatten()
}

/// The errors of every frame, as CSV: lengths in metres, `mse` in the paper's unit.
pub fn frames_table(cases: &[Case]) -> String {
    let mut text =
        "case,frame,time,distance,front_error,height_error,centre_error,mse\n".to_owned();
    for errors in all(cases) {
        for (frame, e) in errors.frames.iter().zip(&errors.errors) {
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "{},{frame},{:.6},{:.6e},{:.6e},{:.6e},{:.6e},{:.6e}",
                csv_cell(&errors.case),
                e.time,
                e.distance,
                e.front,
                e.height,
                e.centre,
                e.mse
            );
        }
    }
    text
}

/// The errors of a rollout in a few numbers; [`summaries`] gives those of several.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Name of the trajectory.
    pub case: String,
    /// Root mean square distance over points and frames (m); infinite if the rollout ended early.
    pub distance_mean: f64,
    /// Mean square distance over points and frames (box²); infinite if the rollout ended early.
    pub mse_mean: f64,
    /// Errors where they are largest; none if no frame was predicted.
    pub peak: Option<FrameError>,
    /// The frame of the peak.
    pub peak_frame: Option<usize>,
    /// Errors of the last frame; none if no frame was predicted.
    pub last: Option<FrameError>,
    /// Why the rollout ended early; empty otherwise.
    pub failure: String,
}

impl Summary {
    fn of(errors: &Errors) -> Self {
        Self {
            case: errors.case.clone(),
            distance_mean: errors.mean_distance(),
            mse_mean: errors.mean(),
            peak: errors.peak().map(|(error, _)| error),
            peak_frame: errors.peak().map(|(_, frame)| frame),
            last: errors.last(),
            failure: errors.failure.clone().unwrap_or_default(),
        }
    }

    /// Mean, largest and final distance, and where they are, as cells; empty where nothing was predicted.
    fn distances(&self, number: fn(f64) -> String) -> [String; 7] {
        let of = |error: Option<FrameError>, value: fn(&FrameError) -> f64| {
            error.map_or(String::new(), |error| number(value(&error)))
        };
        [
            number(self.distance_mean),
            of(self.peak, |peak| peak.distance),
            self.peak_frame.map_or(String::new(), |frame| frame.to_string()),
            of(self.last, |last| last.distance),
            of(self.last, |last| last.front),
            of(self.last, |last| last.height),
            of(self.last, |last| last.centre),
        ]
    }

    /// The mean of several rows, of those that predicted anything; with the latest peak frame and
    /// absolute errors of the front.
    fn mean(case: &str, rows: &[Self]) -> Self {
        let peaks: Vec<FrameError> = rows.iter().filter_map(|row| row.peak).collect();
        let lasts: Vec<FrameError> = rows.iter().filter_map(|row| row.last).collect();
        let nothing = rows.len() - lasts.len();
        Self {
            case: case.to_owned(),
            distance_mean: mean(rows.iter().map(|row| row.distance_mean)).unwrap_or_default(),
            mse_mean: mean(rows.iter().map(|row| row.mse_mean)).unwrap_or_default(),
            peak: mean_error(&peaks),
            peak_frame: rows.iter().filter_map(|row| row.peak_frame).max(),
            last: mean_error(&lasts),
            failure: match nothing {
                0 => String::new(),
                _ => format!("without {nothing} that predicted nothing"),
            },
        }
    }
}

/// The mean of each number, of the front of its size; `None` without errors.
fn mean_error(errors: &[FrameError]) -> Option<FrameError> {
    let of = |value: fn(&FrameError) -> f64| mean(errors.iter().map(value));
    Some(FrameError {
        time: of(|e| e.time)?,
        distance: of(|e| e.distance)?,
        mse: of(|e| e.mse)?,
        front: of(|e| e.front.abs())?,
        height: of(|e| e.height)?,
        centre: of(|e| e.centre)?,
    })
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> Option<f64> {
    let count = values.len();
    (count > 0).then(|| values.sum::<f64>() / count as f64)
}

/// A row for each rollout and noise floor, then the means of both.
pub fn summaries(cases: &[Case]) -> Vec<Summary> {
    let rollouts: Vec<Summary> = cases.iter().map(|case| Summary::of(&case.rollout)).collect();
    let floors: Vec<Summary> =
        cases.iter().filter_map(|case| case.floor.as_ref()).map(Summary::of).collect();
    let mut rows: Vec<Summary> = all(cases).map(Summary::of).collect();
    rows.push(Summary::mean("mean", &rollouts));
    if !floors.is_empty() {
        rows.push(Summary::mean("mean floor", &floors));
    }
    rows
}

/// The summary as CSV: lengths in metres, `mse` in the paper's unit.
pub fn summary_table(cases: &[Case]) -> String {
    let mut text = "case,distance_mean,distance_peak,peak_frame,distance_final,front_error_final,\
                    height_error_final,centre_error_final,mse_mean,mse_peak,mse_final,failure\n"
        .to_owned();
    let number = |x: f64| format!("{x:.6e}");
    for row in summaries(cases) {
        let squares = [Some(row.mse_mean), row.peak.map(|e| e.mse), row.last.map(|e| e.mse)];
        let cells: Vec<String> = [csv_cell(&row.case)]
            .into_iter()
            .chain(row.distances(number))
            .chain(squares.map(|square| square.map_or(String::new(), number)))
            .chain([csv_cell(&row.failure)])
            .collect();
        text += &cells.join(",");
        text.push('\n');
    }
    text
}

/// The summary as a table for the terminal, in metres.
pub fn report(cases: &[Case]) -> String {
    let titles = ["mean", "largest", "at frame", "final", "front", "height", "centre"];
    let mut text =
        "Distances from the trajectories in metres, root mean squares over the points;\n\
                    front, height and centre of mass at the end.\n\n"
            .to_owned();
    let line = |text: &mut String, name: &str, cells: [String; 7], end: &str| {
        let [mean, peak, frame, last, front, height, centre] = cells;
        let line = format!(
            "{name:<22}{mean:>9}{peak:>9}{frame:>10}{last:>9}{front:>9}{height:>9}{centre:>9}  {end}"
        );
        *text += line.trim_end();
        text.push('\n');
    };
    line(&mut text, "", titles.map(str::to_owned), "");
    for row in summaries(cases) {
        line(&mut text, &row.case, row.distances(|x| format!("{x:.4}")), &row.failure);
    }
    text
}

/// Distances over time of all rollouts, and of the noise floors as references.
pub fn chart(cases: &[Case]) -> Chart {
    let line = |errors: &Errors, mark| {
        let points = errors.errors.iter().map(|e| (e.time, e.distance)).collect();
        Series::new(&*errors.case, mark, points)
    };
    let rollouts = cases.iter().map(|case| line(&case.rollout, Mark::Line));
    let floors = cases
        .iter()
        .filter_map(|case| case.floor.as_ref())
        .map(|floor| line(floor, Mark::Reference));
    Chart {
        x: Axis::linear("time [s]"),
        y: Axis::log("distance of points, root mean square [m]"),
        series: rollouts.chain(floors).collect(),
        floor: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rollout in a box of 10 m with these distances (m).
    fn case(name: &str, distances: &[f64], failure: Option<&str>) -> Case {
        let error = |&distance: &f64| FrameError {
            distance,
            mse: distance * distance / 100.0,
            ..FrameError::default()
        };
        let rollout = Errors {
            case: name.to_owned(),
            frames: (6..6 + distances.len()).collect(),
            errors: distances.iter().map(error).collect(),
            failure: failure.map(str::to_owned),
        };
        Case { path: name.into(), rollout, floor: None }
    }

    /// Distances of 1 m and 7 m are 5 m in the root mean square, and 0.25 box² in a box of 10 m.
    #[test]
    fn a_rollout_without_frames_is_not_perfect() {
        let cases =
            [case("a,b", &[1.0, 7.0], None), case("lost", &[], Some("frame 6: 9, at most 5"))];
        let table = summary_table(&cases);
        let rows: Vec<&str> = table.lines().collect();
        let zeros = "0.000000e0,0.000000e0,0.000000e0";
        let ends = |mean: &str| format!("{mean},7.000000e0,7,7.000000e0,{zeros}");
        let row = format!("\"a,b\",{},2.500000e-1,4.900000e-1,4.900000e-1,", ends("5.000000e0"));
        assert_eq!(rows[1], row);
        assert_eq!(rows[2], "lost,inf,,,,,,,inf,,,\"frame 6: 9, at most 5\"");
        // The means are those of the other rollout, which the last column states.
        let mean = format!("mean,{},inf,4.900000e-1,4.900000e-1,", ends("inf"));
        assert_eq!(rows[3], format!("{mean}without 1 that predicted nothing"));
        assert!(report(&cases).contains("a,b                      5.0000   7.0000         7"));
    }
}
