//! `surrogate stats`: statistics of training data.

use std::path::{Path, PathBuf};

use files::{PrintError, out};
use miette::bail;

use crate::data::{DataFolder, DataSet, Statistics, Welford, WindowShape};
use crate::diagnostics::TrainingRange;
use crate::simulator::Simulator;

/// Arguments of `surrogate stats`.
#[derive(clap::Args)]
pub struct StatsArgs {
    /// Folder with trajectory files (*.h5), or with train/ and valid/
    data: PathBuf,
    /// Frames of a window
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u64).range(2..=100))]
    frames: u64,
    /// Take every n-th frame
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1000))]
    stride: u64,
    /// Model (safetensors) trained on these data, to write their range into
    #[arg(long, value_name = "MODEL")]
    into: Option<PathBuf>,
}

/// Prints statistics of the training files.
///
/// # Errors
/// If a file cannot be read, does not fit the others or holds no motion.
pub fn stats(args: &StatsArgs) -> miette::Result<()> {
    let folder = DataFolder::open(&args.data)?;
    let shape =
        WindowShape { frames: args.frames as usize, stride: args.stride as usize, before: 0 };
    let data = DataSet::open(&folder.train, shape, 0)?;
    list(&data, "")?;
    for path in &folder.valid {
        let alone = DataSet::open(std::slice::from_ref(path), shape, 0)?;
        list(&alone, "  validation")?;
        // Checks all frames.
        Statistics::measure(&alone, false)?;
    }
    out!(
        "{} training files, {} validation files; {} windows of {} frames, {} s apart",
        folder.train.len(),
        folder.valid.len(),
        data.len(),
        shape.frames,
        data.frame_interval()
    )?;
    let statistics = Statistics::measure(&data, false)?;
    let Statistics { velocity, acceleration } = statistics;
    out!("{:<16}{:>14}{:>14}{:>12}", "", "mean", "deviation", "values")?;
    let line = |name: &str, w: Welford| {
        out!("{name:<16}{:>14.4e}{:>14.4e}{:>12}", w.mean(), w.deviation(), w.count())
    };
    line("v_x [m/frame]", velocity[0])?;
    line("v_y [m/frame]", velocity[1])?;
    line("a_x [m/frame²]", acceleration[0])?;
    line("a_y [m/frame²]", acceleration[1])?;
    if velocity.iter().chain(&acceleration).all(|w| w.deviation() == 0.0) {
        bail!("{}: nothing moves in these trajectories", args.data.display());
    }
    match &args.into {
        Some(model) => add_range(&data, model),
        None => Ok(()),
    }
}

/// Writes the range of the training data into a model.
fn add_range(data: &DataSet, path: &Path) -> miette::Result<()> {
    let mut simulator = Simulator::load(path)?;
    let (found, needed) = (data.frame_interval(), simulator.training.frame_interval);
    if !simulator.training.is_interval(found) {
        bail!(
            help = "--stride N takes every n-th frame of the data",
            "{}: trained on frames {needed} s apart, but these are {found} s apart",
            path.display()
        );
    }
    let range = TrainingRange::of(data, simulator.config.connection_radius)?;
    if simulator.training.range.is_some() && simulator.training.range != range {
        bail!(
            help = "rollouts compare their initial frames with this range",
            "{}: states another range of its training data already",
            path.display()
        );
    }
    simulator.training.range = range;
    simulator.training.material = data.material().map(str::to_owned);
    simulator.save(path)?;
    out!("{}: the range of these data is recorded", path.display())?;
    Ok(())
}

fn list(data: &DataSet, purpose: &str) -> Result<(), PrintError> {
    for recording in data.recordings() {
        let (path, points) = (recording.path().display(), recording.points());
        let unfinished = match recording.status() {
            "finished" => String::new(),
            status => format!("  not finished: {status}"),
        };
        let frames = recording.frames();
        out!("{path:<40}{points:>6} points{frames:>6} frames{purpose}{unfinished}")?;
    }
    Ok(())
}
