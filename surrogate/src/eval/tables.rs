//! The results of an evaluation as tables and a chart.

use std::fmt::Write as _;

use plotters::prelude::SeriesLabelPosition;

use super::Case;
use crate::chart::{Chart, Line};
use crate::metrics::{Errors, FrameError};

/// Everything that was compared: each rollout, then its noise floor.
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
                errors.case, e.time, e.mse, e.front, e.height, e.centre
            );
        }
    }
    text
}

/// What a row of a summary says.
struct Row<'a> {
    case: &'a str,
    mean: f64,
    peak: f64,
    peak_frame: usize,
    last: FrameError,
    failure: &'a str,
}

impl<'a> Row<'a> {
    fn of(errors: &'a Errors) -> Self {
        let (peak, peak_frame) = errors.peak();
        Self {
            case: &errors.case,
            mean: errors.mean(),
            peak,
            peak_frame,
            last: errors.last(),
            failure: errors.failure.as_deref().unwrap_or(""),
        }
    }

    /// What stands in the columns, given how to write a mean square and a length.
    fn cells(&self, mse: fn(f64) -> String, length: fn(f64) -> String) -> [String; 9] {
        [
            self.case.to_owned(),
            mse(self.mean),
            mse(self.peak),
            self.peak_frame.to_string(),
            mse(self.last.mse),
            length(self.last.front),
            length(self.last.height),
            length(self.last.centre),
            self.failure.to_owned(),
        ]
    }

    /// The mean of several rows, the latest peak, and no sign of the front's error.
    fn mean(case: &'a str, rows: &[Self]) -> Self {
        let mean = |value: &dyn Fn(&Self) -> f64| {
            rows.iter().map(value).sum::<f64>() / rows.len().max(1) as f64
        };
        Self {
            case,
            mean: mean(&|row| row.mean),
            peak: mean(&|row| row.peak),
            peak_frame: rows.iter().map(|row| row.peak_frame).max().unwrap_or(0),
            last: FrameError {
                time: mean(&|row| row.last.time),
                mse: mean(&|row| row.last.mse),
                front: mean(&|row| row.last.front.abs()),
                height: mean(&|row| row.last.height),
                centre: mean(&|row| row.last.centre),
            },
            failure: "",
        }
    }
}

/// A row for everything that was compared, then the means of rollouts and of noise floors.
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

/// A row for everything that was compared, as CSV.
pub fn summary_table(cases: &[Case]) -> String {
    let mut text = "case,mse_mean,mse_peak,peak_frame,mse_final,front_error_final,\
                    height_error_final,centre_error_final,failure\n"
        .to_owned();
    let number = |x: f64| format!("{x:.6e}");
    for row in rows(cases) {
        text += &row.cells(number, number).join(",");
        text.push('\n');
    }
    text
}

/// The same for people.
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

/// The MSE of everything that was compared over time, noise floors in black.
pub fn chart(cases: &[Case]) -> Chart {
    let line = |errors: &Errors, reference| Line {
        name: errors.case.clone(),
        points: errors.errors.iter().map(|e| (e.time, e.mse)).collect(),
        reference,
    };
    let rollouts = cases.iter().map(|case| line(&case.rollout, false));
    let floors = cases.iter().filter_map(|case| case.floor.as_ref()).map(|floor| line(floor, true));
    Chart {
        title: "Error of the rollouts".to_owned(),
        x: "time [s]".to_owned(),
        y: "MSE [box²]".to_owned(),
        lines: rollouts.chain(floors).collect(),
        legend: SeriesLabelPosition::LowerRight,
    }
}
