//! `dempm plot`: draws or animates a trajectory.

use std::path::{Path, PathBuf};

use files::{announce, note, refuse_input, refuse_same};
use miette::{Report, WrapErr};

use crate::figures::{FigureError, Options, Quantity, Selection, Undrawn, animate, draw};
use crate::trajectory::Trajectory;

/// The arguments of `dempm plot`.
#[derive(clap::Args, Clone, Debug)]
pub struct PlotArgs {
    /// The trajectory file
    pub file: PathBuf,
    /// The figure to write (PNG) [default: FILE with suffix .png]
    #[arg(short, long, value_name = "PNG")]
    pub output: Option<PathBuf>,
    /// Frames to show, such as 0,50,last [default: four over the whole run; all when animated]
    #[arg(long, value_delimiter = ',', conflicts_with = "times")]
    pub frames: Vec<String>,
    /// Times to show, in seconds; each picks the nearest frame
    #[arg(long, value_delimiter = ',', value_name = "SECONDS")]
    pub times: Vec<f64>,
    /// Draw the grains instead of points, in frames that have them
    #[arg(long)]
    pub grains: bool,
    /// The quantity that the colours show [default: speed; layer with --grains]
    #[arg(long, value_enum)]
    pub field: Option<Quantity>,
    /// Logarithmic colours
    #[arg(long)]
    pub log: bool,
    /// Write an animation: GIF, or MP4 where ffmpeg is installed
    #[arg(long, value_name = "GIF|MP4")]
    pub animate: Option<PathBuf>,
    /// Width in pixels [default: 1600; 960 when animated]
    #[arg(long, value_parser = clap::value_parser!(u32).range(320..=8000))]
    pub width: Option<u32>,
    /// Frames a second of the animation
    #[arg(long, default_value_t = 25, value_parser = clap::value_parser!(u32).range(1..=50))]
    pub fps: u32,
}

impl PlotArgs {
    fn options(&self) -> Options {
        let frames = match (self.times.is_empty(), self.frames.is_empty()) {
            (false, _) => Selection::Times(self.times.clone()),
            (true, false) => Selection::Frames(self.frames.clone()),
            (true, true) => Selection::Default,
        };
        let usual = if self.grains { Quantity::Layer } else { Quantity::Speed };
        let quantity = self.field.unwrap_or(usual);
        Options { grains: self.grains, quantity, log: self.log, frames, width: self.width }
    }
}

/// Draws or animates a trajectory and prints the names of the files.
///
/// # Errors
/// If the trajectory cannot be read, has no such frames or fields, or a file cannot be written.
pub fn plot(args: &PlotArgs) -> miette::Result<()> {
    let trajectory = Trajectory::open(&args.file)?;
    if trajectory.frames() == 0 {
        return Err(FigureError::Empty { path: args.file.clone() }.into());
    }
    let options = args.options();
    // Without an explicit -o, an animation comes without a figure.
    let figure = match (&args.output, &args.animate) {
        (Some(output), _) => Some(output.clone()),
        (None, None) => Some(args.file.with_extension("png")),
        (None, Some(_)) => None,
    };
    let outputs: Vec<&Path> =
        args.animate.iter().chain(figure.as_ref()).map(PathBuf::as_path).collect();
    refuse_same(&outputs)?;
    for output in &outputs {
        refuse_input(output, [&args.file])?;
    }
    let told = |output: &Path, undrawn: Result<Undrawn, FigureError>| {
        let undrawn = undrawn
            .map_err(Report::new)
            .wrap_err_with(|| format!("cannot write {}", output.display()))?;
        if let Some((frame, point)) = undrawn.first {
            note!(
                "{}: {} positions are not finite and not drawn, the first at frame {frame}, point {point}",
                output.display(),
                undrawn.count
            );
        }
        announce!("{}", output.display());
        miette::Result::<()>::Ok(())
    };
    if let Some(output) = &args.animate {
        told(output, animate(&trajectory, &options, args.fps, output))?;
    }
    if let Some(output) = &figure {
        told(output, draw(&trajectory, &options, output))?;
    }
    Ok(())
}
