//! Results of an evaluation as tables and a chart.

use std::fmt::Write as _;

use files::csv_cell;
use plot::{Axis, Chart, Mark, Series};

use super::compare::Case;
use super::metrics::{Errors, FrameError};

/// Each rollout, followed by its noise floor.
fn all(cases: &[Case]) -> impl Iterator<Item = &Errors> {
    cases.iter().flat_map(|case| [Some(&case.rollout), case.floor.as_ref()]).flatten()
}

/// The errors of every frame, as CSV.
pub fn frames_table(cases: &[Case]) -> String {
    let mut text = "case,frame,time,mse,front_error,height_error,centre_error\n".to_owned();
    for errors in all(cases) {
        for (frame, e) in errors.frames.iter().zip(&errors.errors) {
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "{},{frame},{:.6},{:.6e},{:.6e},{:.6e},{:.6e}",
                csv_cell(&errors.case),
                e.time,
                e.mse,
                e.front,
                e.height,
                e.centre
            );
        }
    }
    text
}

/// A row of a summary.
struct Row<'a> {
    case: &'a str,
    /// Mean MSE.
    mean: f64,
    /// Largest MSE and its frame; none if no frame was predicted.
    peak: Option<(f64, usize)>,
    /// Errors of the last frame.
    last: Option<FrameError>,
    failure: String,
}

impl<'a> Row<'a> {
    fn of(errors: &'a Errors) -> Self {
        Self {
            case: &errors.case,
            mean: errors.mean(),
            peak: errors.peak(),
            last: errors.last(),
            failure: errors.failure.clone().unwrap_or_default(),
        }
    }

    /// The cells, given how to format a mean square and a length.
    fn cells(&self, mse: fn(f64) -> String, length: fn(f64) -> String) -> [String; 9] {
        let last = |of: fn(FrameError) -> f64, write: fn(f64) -> String| {
            self.last.map_or(String::new(), |last| write(of(last)))
        };
        [
            self.case.to_owned(),
            mse(self.mean),
            self.peak.map_or(String::new(), |(peak, _)| mse(peak)),
            self.peak.map_or(String::new(), |(_, frame)| frame.to_string()),
            last(|last| last.mse, mse),
            last(|last| last.front, length),
            last(|last| last.height, length),
            last(|last| last.centre, length),
            self.failure.clone(),
        ]
    }

    /// The mean of several rows, of those that predicted anything; with the latest peak frame and
    /// absolute errors of the front.
    fn mean(case: &'a str, rows: &[Self]) -> Self {
        let peaks: Vec<(f64, usize)> = rows.iter().filter_map(|row| row.peak).collect();
        let lasts: Vec<FrameError> = rows.iter().filter_map(|row| row.last).collect();
        let of = |value: fn(&FrameError) -> f64| mean(lasts.iter().map(value)).unwrap_or_default();
        let nothing = rows.len() - lasts.len();
        Self {
            case,
            mean: mean(rows.iter().map(|row| row.mean)).unwrap_or_default(),
            peak: mean(peaks.iter().map(|peak| peak.0)).zip(peaks.iter().map(|peak| peak.1).max()),
            last: (!lasts.is_empty()).then(|| FrameError {
                time: of(|last| last.time),
                mse: of(|last| last.mse),
                front: of(|last| last.front.abs()),
                height: of(|last| last.height),
                centre: of(|last| last.centre),
            }),
            failure: match nothing {
                0 => String::new(),
                _ => format!("without {nothing} that predicted nothing"),
            },
        }
    }
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> Option<f64> {
    let count = values.len();
    (count > 0).then(|| values.sum::<f64>() / count as f64)
}

/// A row for each rollout and noise floor, then the means of both.
fn rows(cases: &[Case]) -> Vec<Row<'_>> {
    let rollouts: Vec<Row> = cases.iter().map(|case| Row::of(&case.rollout)).collect();
    let floors: Vec<Row> =
        cases.iter().filter_map(|case| case.floor.as_ref()).map(Row::of).collect();
    let mut rows: Vec<Row> = all(cases).map(Row::of).collect();
    rows.push(Row::mean("mean", &rollouts));
    if !floors.is_empty() {
        rows.push(Row::mean("mean floor", &floors));
    }
    rows
}

/// The summary as CSV.
pub fn summary_table(cases: &[Case]) -> String {
    let mut text = "case,mse_mean,mse_peak,peak_frame,mse_final,front_error_final,\
                    height_error_final,centre_error_final,failure\n"
        .to_owned();
    let number = |x: f64| format!("{x:.6e}");
    for row in rows(cases) {
        text += &row.cells(number, number).map(|cell| csv_cell(&cell)).join(",");
        text.push('\n');
    }
    text
}

/// The summary as a table for the terminal.
pub fn report(cases: &[Case]) -> String {
    let titles =
        ["case", "MSE mean", "peak", "frame", "final", "front [m]", "height [m]", "centre [m]", ""];
    let mut text = String::new();
    let rows = rows(cases);
    let rows = rows.iter().map(|row| row.cells(|mse| format!("{mse:.2e}"), |m| format!("{m:.4}")));
    for [case, mean, peak, frame, last, front, height, centre, failure] in
        [titles.map(str::to_owned)].into_iter().chain(rows)
    {
        let line = format!(
            "{case:<22}{mean:>11}{peak:>11}{frame:>7}{last:>11}{front:>11}{height:>11}{centre:>11}  {failure}"
        );
        text += line.trim_end();
        text.push('\n');
    }
    text
}

/// MSE over time of all rollouts, and of the noise floors as references.
pub fn chart(cases: &[Case]) -> Chart {
    let line = |errors: &Errors, mark| {
        let points = errors.errors.iter().map(|e| (e.time, e.mse)).collect();
        Series::new(&*errors.case, mark, points)
    };
    let rollouts = cases.iter().map(|case| line(&case.rollout, Mark::Line));
    let floors = cases
        .iter()
        .filter_map(|case| case.floor.as_ref())
        .map(|floor| line(floor, Mark::Reference));
    Chart {
        x: Axis::linear("time [s]"),
        y: Axis::log("MSE [box²]"),
        series: rollouts.chain(floors).collect(),
        floor: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case(name: &str, mse: &[f64], failure: Option<&str>) -> Case {
        let errors = mse.iter().map(|&mse| FrameError { mse, ..FrameError::default() }).collect();
        let rollout = Errors {
            case: name.to_owned(),
            frames: (6..6 + mse.len()).collect(),
            errors,
            failure: failure.map(str::to_owned),
        };
        Case { path: name.into(), rollout, floor: None }
    }

    #[test]
    fn a_rollout_without_frames_is_not_perfect() {
        let cases =
            [case("a,b", &[1.0, 3.0], None), case("lost", &[], Some("frame 6: 9, at most 5"))];
        let table = summary_table(&cases);
        let rows: Vec<&str> = table.lines().collect();
        let row = "\"a,b\",2.000000e0,3.000000e0,7,3.000000e0,0.000000e0,0.000000e0,0.000000e0,";
        assert_eq!(rows[1], row);
        assert_eq!(rows[2], "lost,inf,,,,,,,\"frame 6: 9, at most 5\"");
        // The means are those of the other rollout, which the last column states.
        let mean = "mean,inf,3.000000e0,7,3.000000e0,0.000000e0,0.000000e0,0.000000e0,";
        assert_eq!(rows[3], format!("{mean}without 1 that predicted nothing"));
    }
}
