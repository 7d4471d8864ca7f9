//! `surrogate eval`: rollouts beside the trajectories that they should reproduce.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use dempm::trajectory::{Trajectory, TrajectoryError, WriteError, write_atomically};
use miette::bail;
use plotters::prelude::SeriesLabelPosition;

use crate::chart::{Chart, Line};
use crate::data::trajectories_in;
use crate::metrics::{Errors, FrameError};
use crate::rollout::Rollout;
use crate::simulator::Simulator;
use crate::start::{Start, StartError, stride};

/// Arguments of `surrogate eval`.
#[derive(clap::Args)]
pub struct EvalArgs {
    /// Model (safetensors)
    model: PathBuf,
    /// Folder of trajectory files (*.h5) to reproduce
    #[arg(long)]
    data: PathBuf,
    /// Folder for the tables and the chart
    #[arg(short, long, default_value = "eval")]
    output: PathBuf,
    /// Compare at most so many frames of each
    #[arg(long)]
    frames: Option<usize>,
    /// Two runs of one scene that differ in the seed: no surrogate can be better than their
    /// difference lets it
    #[arg(long, num_args = 2, value_names = ["A", "B"])]
    noise_floor: Option<Vec<PathBuf>>,
}

/// Rolls a model out from the first frames of a trajectory and compares it with the rest.
///
/// A rollout that breaks down is a result: its errors end there and say why.
///
/// # Errors
/// If the trajectory cannot be read or does not fit the model.
pub fn errors(
    simulator: &Simulator,
    path: &Path,
    frames: Option<usize>,
) -> Result<Errors, StartError> {
    let start = Start::from_trajectory(path, 0, simulator)?;
    let truth = Trajectory::open(path)?;
    let header = truth.header();
    let stride = stride(simulator.training.frame_interval, header.frame_interval, || name(path))?;
    let mut errors = Errors { case: name(path), ..Errors::default() };
    let mut rollout = Rollout::new(simulator, &start);
    let last = frames.unwrap_or(start.frames).min(start.frames);
    while rollout.frame() + 1 < last {
        let frame = rollout.frame() + 1;
        let predicted = match rollout.advance() {
            Ok(predicted) => predicted,
            Err(error) => {
                errors.failure = Some(error.to_string());
                break;
            }
        };
        let truth = truth.frame(frame * stride)?;
        errors.frames.push(frame);
        errors.errors.push(FrameError::between(
            predicted,
            &truth.position,
            truth.time,
            header.domain[0],
            header.point_spacing,
        ));
    }
    Ok(errors)
}

/// The differences between two trajectories of as many points.
///
/// # Errors
/// If a file cannot be read.
fn difference(a: &Path, b: &Path) -> Result<Errors, TrajectoryError> {
    let [a, b] = [Trajectory::open(a)?, Trajectory::open(b)?];
    let header = b.header();
    let case = format!("{} - {}", name(a.path()), name(b.path()));
    let mut errors = Errors { case, ..Errors::default() };
    for frame in 0..a.frames().min(b.frames()) {
        let (one, other) = (a.frame(frame)?, b.frame(frame)?);
        errors.frames.push(frame);
        errors.errors.push(FrameError::between(
            &one.position,
            &other.position,
            other.time,
            header.domain[0],
            header.point_spacing,
        ));
    }
    Ok(errors)
}

/// Evaluates a model.
///
/// # Errors
/// If a file is wrong or the results cannot be written.
pub fn eval(args: &EvalArgs) -> miette::Result<()> {
    let simulator = Simulator::load(&args.model)?;
    let mut cases = Vec::new();
    for path in trajectories_in(&args.data)? {
        let began = Instant::now();
        let case = errors(&simulator, &path, args.frames)?;
        let per_frame = began.elapsed().as_secs_f64() / case.errors.len().max(1) as f64;
        eprintln!("{}: {} frames, {per_frame:.3} s each", case.case, case.errors.len());
        cases.push(case);
    }
    let floor = match args.noise_floor.as_deref() {
        Some([a, b]) => {
            let [points_a, points_b] =
                [Trajectory::open(a)?, Trajectory::open(b)?].map(|t| t.points().mass.len());
            if points_a != points_b {
                bail!(
                    "--noise-floor: {} has {points_a} points, but {} has {points_b}",
                    a.display(),
                    b.display()
                );
            }
            Some(difference(a, b)?)
        }
        _ => None,
    };
    write_text(&args.output.join("frames.csv"), &frames_table(cases.iter().chain(&floor)))?;
    let summary = summary_table(&cases, floor.as_ref());
    write_text(&args.output.join("summary.csv"), &summary)?;
    chart(&cases, floor.as_ref()).write(&args.output.join("errors.svg"))?;
    print!("{}", report(&cases, floor.as_ref()));
    println!("written: {}/{{summary.csv, frames.csv, errors.svg}}", args.output.display());
    Ok(())
}

fn frames_table<'a>(cases: impl Iterator<Item = &'a Errors>) -> String {
    let mut text = "case,frame,time,mse,front_error,height_error,centre_error\n".to_owned();
    for case in cases {
        for (frame, e) in case.frames.iter().zip(&case.errors) {
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "{},{frame},{:.6},{:.6e},{:.6e},{:.6e},{:.6e}",
                case.case, e.time, e.mse, e.front, e.height, e.centre
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
}

/// A row for every case, their mean, and the noise floor.
fn rows<'a>(cases: &'a [Errors], floor: Option<&'a Errors>) -> Vec<Row<'a>> {
    let mut rows: Vec<Row<'a>> = cases.iter().map(Row::of).collect();
    let mean = |value: &dyn Fn(&Row<'a>) -> f64| {
        rows.iter().map(value).sum::<f64>() / rows.len().max(1) as f64
    };
    let average = Row {
        case: "mean",
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
    };
    rows.push(average);
    rows.extend(floor.map(|floor| Row { case: "noise floor", ..Row::of(floor) }));
    rows
}

fn summary_table(cases: &[Errors], floor: Option<&Errors>) -> String {
    let mut text = "case,mse_mean,mse_peak,peak_frame,mse_final,front_error_final,\
                    height_error_final,centre_error_final,failure\n"
        .to_owned();
    for row in rows(cases, floor) {
        let Row { case, mean, peak, peak_frame, last, failure } = row;
        let _ = writeln!(
            text,
            "{case},{mean:.6e},{peak:.6e},{peak_frame},{:.6e},{:.6e},{:.6e},{:.6e},{failure}",
            last.mse, last.front, last.height, last.centre
        );
    }
    text
}

fn report(cases: &[Errors], floor: Option<&Errors>) -> String {
    let mut text = format!(
        "{:<22}{:>11}{:>11}{:>7}{:>11}{:>11}{:>11}{:>11}\n",
        "case", "MSE mean", "peak", "frame", "final", "front [m]", "height [m]", "centre [m]"
    );
    for row in rows(cases, floor) {
        let Row { case, mean, peak, peak_frame, last, failure } = row;
        let _ = writeln!(
            text,
            "{case:<22}{mean:>11.2e}{peak:>11.2e}{peak_frame:>7}{:>11.2e}{:>11.4}{:>11.4}{:>11.4}  {failure}",
            last.mse, last.front, last.height, last.centre
        );
    }
    text
}

fn chart(cases: &[Errors], floor: Option<&Errors>) -> Chart {
    let line = |errors: &Errors, name: &str, reference| Line {
        name: name.to_owned(),
        points: errors.errors.iter().map(|e| (e.time, e.mse)).collect(),
        reference,
    };
    let mut lines: Vec<Line> = cases.iter().map(|case| line(case, &case.case, false)).collect();
    lines.extend(floor.map(|floor| line(floor, "noise floor", true)));
    Chart {
        title: "Error of the rollouts".to_owned(),
        x: "time [s]".to_owned(),
        y: "MSE [box²]".to_owned(),
        lines,
        legend: SeriesLabelPosition::LowerRight,
    }
}

fn name(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

fn write_text(path: &Path, text: &str) -> Result<(), WriteError> {
    write_atomically(path, |temporary| {
        std::fs::write(temporary, text).map_err(|source| WriteError {
            path: path.to_owned(),
            action: "write it",
            source,
        })
    })
}
