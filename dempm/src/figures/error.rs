//! Errors of figures and animations.

use std::path::PathBuf;
use std::process::ExitStatus;

use files::WriteError;
use plot::PlotError;

use crate::trajectory::TrajectoryError;

/// A figure or animation that could not be drawn.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum FigureError {
    /// The trajectory cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Trajectory(#[from] TrajectoryError),
    /// The file cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
    /// Drawing or encoding failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Plot(#[from] PlotError),
    /// The image cannot be written as PNG.
    #[error("cannot write the PNG")]
    Encode(#[from] image::ImageError),
    /// The trajectory is empty.
    #[error("{}: no frames yet, so there is nothing to draw", path.display())]
    Empty {
        /// The trajectory file.
        path: PathBuf,
    },
    /// The trajectory lacks the field that the quantity is computed from.
    #[error("{}: the file has no {field}, which {quantity} is computed from", path.display())]
    #[diagnostic(help("[output] fields in the scene file chooses the recorded fields"))]
    NoField {
        /// The trajectory file.
        path: PathBuf,
        /// Name of the field.
        field: &'static str,
        /// The quantity to draw.
        quantity: &'static str,
    },
    /// The trajectory has no grains.
    #[error("{}: the file has no grains", path.display())]
    #[diagnostic(help("[output] grains_every in a scene of discs records them"))]
    NoGrains {
        /// The trajectory file.
        path: PathBuf,
    },
    /// Means of grains, which belong to no cell.
    #[error("--average takes means over points, not over grains")]
    AverageOfGrains,
    /// Differences of grains, which are other grains in each run.
    #[error("differences are those of points, not of grains")]
    DifferenceOfGrains,
    /// Runs without frames at the same time.
    #[error("the runs have no time in common")]
    NoCommonTime,
    /// Runs that do not start with the same material.
    #[error("{} does not start with the material of {}", one.display(), other.display())]
    #[diagnostic(help("--compare side and overlay show any two runs"))]
    OtherMaterial {
        /// The run to compare.
        one: PathBuf,
        /// The one to compare it with.
        other: PathBuf,
    },
    /// A frame that not all runs have.
    #[error("another run has no frame at the time of frame {0}")]
    NotCommon(usize),
    /// A frame without grains.
    #[error("frame {frame} has no grains: {}", interval(*every))]
    NoGrainsAt {
        /// The frame asked for.
        frame: usize,
        /// Frames from one with grains to the next.
        every: usize,
    },
    /// A quantity of points that grains do not have.
    #[error("grains have no {0}")]
    #[diagnostic(help(
        "they have layer, speed, velocity-x, velocity-y, pressure, displacement and column"
    ))]
    NotOfGrains(&'static str),
    /// A frame beyond the last one.
    #[error("there is no frame {frame}: the file has {frames}, from 0 to {}", frames - 1)]
    NoSuchFrame {
        /// The frame asked for.
        frame: usize,
        /// The number of frames in the file.
        frames: usize,
    },
    /// A word that does not name a frame.
    #[error("`{0}` is not a frame: give a number, `first` or `last`")]
    NotAFrame(String),
    /// A time that is not finite.
    #[error("{0} s is not a time")]
    NotATime(f64),
    /// A time before the first or after the last frame.
    #[error("there is no frame near {time} s: the frames are from {first} to {last} s")]
    OutsideOfTime {
        /// The time (s).
        time: f64,
        /// Time of the first frame (s).
        first: f64,
        /// Time of the last frame (s).
        last: f64,
    },
    /// More panels than fit into a figure.
    #[error("{0} frames are too many for one figure: at most 64")]
    TooManyPanels(usize),
    /// A figure with another suffix than `.png`.
    #[error("{}: figures are .png files; --animate writes .gif and .mp4", path.display())]
    FigureFormat {
        /// The output file.
        path: PathBuf,
    },
    /// An animation with another suffix than `.gif` or `.mp4`.
    #[error("{}: an animation is a .gif or an .mp4 file", path.display())]
    AnimationFormat {
        /// The output file.
        path: PathBuf,
    },
    /// The program ffmpeg does not start.
    #[error("MP4 needs the program ffmpeg, which does not start")]
    #[diagnostic(help("install ffmpeg, or write a .gif file"))]
    NoFfmpeg(#[source] std::io::Error),
    /// ffmpeg stopped while frames were written to it.
    #[error("ffmpeg stopped early")]
    FfmpegStopped(#[source] std::io::Error),
    /// ffmpeg failed at the end.
    #[error("ffmpeg failed ({0})")]
    FfmpegFailed(ExitStatus),
}

/// The frames with grains, in words.
fn interval(every: usize) -> String {
    format!("only frames 0, {every}, {}, ... have", 2 * every)
}
