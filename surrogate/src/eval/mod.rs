//! `surrogate eval`: rollouts beside the trajectories that they should reproduce.

mod tables;

use std::path::{Path, PathBuf};
use std::time::Instant;

use dempm::device::Device;
use dempm::trajectory::{Frame, Header, Trajectory, TrajectoryError};
use files::write_text;
use miette::{Context, IntoDiagnostic, bail};

use self::tables::{chart, frames_table, report, summary_table};
use crate::accuracy::Accuracy;
use crate::data::trajectories_in;
use crate::metrics::{Errors, FrameError};
use crate::rollout::Rollout;
use crate::simulator::Simulator;
use crate::start::{Start, StartError, stride};
use crate::train::Precision;

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
    /// Folder of the same runs with other packings, under the same names: no surrogate can be
    /// expected to come closer to a run than another packing does
    #[arg(long, value_name = "DIR")]
    noise_floor: Option<PathBuf>,
    /// Where to compute: auto, cpu, cuda or cuda:N
    #[arg(long, default_value = "auto")]
    device: Device,
    /// Precision of products on a GPU; bf16 is faster and less exact
    #[arg(long, value_enum, default_value_t = Precision::F32)]
    precision: Precision,
    /// Average each prediction with the mirrored one of the mirrored window
    #[arg(long)]
    mirror: bool,
    /// Write how wrong the model was into its file, for what rollouts say; with data that it has
    /// not learnt from
    #[arg(long)]
    record: bool,
}

/// A trajectory and what was compared with it.
struct Case {
    path: PathBuf,
    rollout: Errors,
    /// The same scene with another packing, over the same frames.
    floor: Option<Errors>,
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
        errors.errors.push(error_of(predicted, &truth, header));
    }
    Ok(errors)
}

/// How far a run of the same scene with another packing is from a trajectory, in the frames that a
/// rollout predicts.
///
/// # Errors
/// If a file cannot be read, or they are not runs of one scene.
fn noise_floor(
    simulator: &Simulator,
    path: &Path,
    twin: &Path,
    frames: Option<usize>,
) -> Result<Errors, FloorError> {
    let [truth, other] = [Trajectory::open(path)?, Trajectory::open(twin)?];
    let (header, found) = (truth.header(), other.header());
    let alike = truth.points().mass.len() == other.points().mass.len()
        && header.domain == found.domain
        && header.frame_interval == found.frame_interval;
    if !alike {
        return Err(FloorError::Scene { path: path.to_owned(), twin: twin.to_owned() });
    }
    let stride = stride(simulator.training.frame_interval, header.frame_interval, || name(path))?;
    let made = truth.frames().min(other.frames()).div_ceil(stride);
    let mut errors = Errors { case: format!("{} floor", name(path)), ..Errors::default() };
    for frame in simulator.first_frames()..frames.unwrap_or(made).min(made) {
        let (one, another) = (truth.frame(frame * stride)?, other.frame(frame * stride)?);
        errors.frames.push(frame);
        errors.errors.push(error_of(&another.position, &one, header));
    }
    Ok(errors)
}

/// The error of positions that should be those of a frame.
fn error_of(positions: &[[f64; 2]], truth: &Frame, header: &Header) -> FrameError {
    let (width, spacing) = (header.domain[0], header.point_spacing);
    FrameError::between(positions, &truth.position, truth.time, width, spacing)
}

/// Why two runs have no noise floor.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
enum FloorError {
    #[error(transparent)]
    #[diagnostic(transparent)]
    Trajectory(#[from] TrajectoryError),
    #[error(transparent)]
    #[diagnostic(transparent)]
    Start(#[from] StartError),
    #[error("--noise-floor: {} is not a run of the scene of {}", twin.display(), path.display())]
    Scene { path: PathBuf, twin: PathBuf },
}

/// Evaluates a model.
///
/// # Errors
/// If a file is wrong or the results cannot be written.
pub fn eval(args: &EvalArgs) -> miette::Result<()> {
    let (mirror, precision) = (args.mirror, args.precision);
    let mut simulator = Simulator { mirror, precision, ..Simulator::load(&args.model)? };
    simulator.place(args.device).into_diagnostic().wrap_err("--device, --precision")?;
    let mut cases = Vec::new();
    for path in trajectories_in(&args.data)? {
        let began = Instant::now();
        let rollout = errors(&simulator, &path, args.frames)?;
        if rollout.errors.is_empty() && rollout.failure.is_none() {
            let given = simulator.first_frames();
            bail!(
                "{}: nothing to compare: the model starts from {given} frames",
                args.frames.map_or(path.display().to_string(), |n| format!("--frames {n}"))
            );
        }
        let per_frame = began.elapsed().as_secs_f64() / rollout.errors.len().max(1) as f64;
        eprintln!("{}: {} frames, {per_frame:.3} s each", rollout.case, rollout.errors.len());
        let twin =
            args.noise_floor.iter().map(|folder| folder.join(path.file_name().unwrap_or_default()));
        let floor = twin
            .filter(|twin| twin.exists())
            .map(|twin| noise_floor(&simulator, &path, &twin, args.frames))
            .next()
            .transpose()?;
        cases.push(Case { path, rollout, floor });
    }
    if let Some(folder) = &args.noise_floor
        && cases.iter().all(|case| case.floor.is_none())
    {
        bail!(
            "--noise-floor: {} has no file with the name of one in {}",
            folder.display(),
            args.data.display()
        );
    }
    write_text(&args.output.join("frames.csv"), &frames_table(&cases))?;
    write_text(&args.output.join("summary.csv"), &summary_table(&cases))?;
    chart(&cases).write(&args.output.join("errors.svg"))?;
    print!("{}", report(&cases));
    println!("written: {}/{{summary.csv, frames.csv, errors.svg}}", args.output.display());
    if args.record {
        let runs = cases.iter().map(|case| (&case.rollout, case.path.as_path()));
        let Some(accuracy) = Accuracy::of(runs)? else {
            bail!("--record: nothing moves in {}", args.data.display());
        };
        simulator.training.accuracy = Some(accuracy);
        simulator.save(&args.model)?;
        println!("recorded in {}", args.model.display());
    }
    Ok(())
}

fn name(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}
