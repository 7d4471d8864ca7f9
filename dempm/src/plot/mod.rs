//! `dempm plot`: pictures and animations of a trajectory.

mod animation;
mod figure;
mod quantity;
mod select;
mod view;

use std::path::{Path, PathBuf};

use files::{refuse_input, write_atomically};
use miette::{IntoDiagnostic, WrapErr, bail};

use self::figure::{Figure, Panel};
pub use self::quantity::Quantity;
use crate::trajectory::Trajectory;

/// The arguments of `dempm plot`.
#[derive(clap::Args, Clone, Debug)]
pub struct PlotArgs {
    /// The trajectory file
    pub file: PathBuf,
    /// The picture to write (PNG) [default: FILE with suffix .png]
    #[arg(short, long, value_name = "PNG")]
    pub output: Option<PathBuf>,
    /// Frames to show, such as 0,50,last [default: four over the whole run; all when animated]
    #[arg(long, value_delimiter = ',', conflicts_with = "times")]
    pub frames: Vec<String>,
    /// Times to show, in seconds; each picks the nearest frame
    #[arg(long, value_delimiter = ',', value_name = "SECONDS")]
    pub times: Vec<f64>,
    /// What the colours show
    #[arg(long, value_enum, default_value_t = Quantity::Speed)]
    pub field: Quantity,
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

/// Draws what the arguments ask for.
///
/// # Errors
/// If the trajectory cannot be read, has no such frames or fields, or a file cannot be written.
pub fn plot(args: &PlotArgs) -> miette::Result<()> {
    let trajectory = Trajectory::open(&args.file)?;
    if trajectory.frames() == 0 {
        bail!("{}: there are no frames yet, so there is nothing to draw", args.file.display());
    }
    if let Some(output) = &args.animate {
        refuse_input(output, [&args.file])?;
        animation::animate(&trajectory, args, output)?;
        println!("{}", output.display());
    }
    // Who asks for an animation only does not want a picture beside it.
    if args.animate.is_none() || args.output.is_some() {
        let output = args.output.clone().unwrap_or_else(|| args.file.with_extension("png"));
        refuse_input(&output, [&args.file])?;
        if output.extension().is_some_and(|suffix| !suffix.eq_ignore_ascii_case("png")) {
            bail!("{}: pictures are PNG; --animate makes GIF and MP4", output.display());
        }
        picture(&trajectory, args, &output)?;
        println!("{}", output.display());
    }
    Ok(())
}

/// Draws the chosen frames as panels of one picture.
fn picture(trajectory: &Trajectory, args: &PlotArgs, output: &Path) -> miette::Result<()> {
    let chosen = match select::frames(trajectory, args)? {
        Some(chosen) => chosen,
        None => select::evenly(trajectory.frames(), 4),
    };
    if chosen.len() > 64 {
        bail!("{} frames are too many for one picture; 64 fit", chosen.len());
    }
    let panels = panels(trajectory, args.field, &chosen)?;
    let figure = Figure::new(trajectory.header(), args, &panels, args.width.unwrap_or(1600));
    let image = figure.draw(&panels)?;
    write_atomically(output, |temporary| {
        // By format, as the temporary name has no suffix that tells it.
        let saved = image.save_with_format(temporary, image::ImageFormat::Png);
        saved.into_diagnostic().map_err(PictureError)
    })
    .map_err(|PictureError(report)| report)
    .wrap_err_with(|| format!("cannot write {}", output.display()))
}

/// Carries a report through [`write_atomically`].
struct PictureError(miette::Report);

impl From<files::WriteError> for PictureError {
    fn from(error: files::WriteError) -> Self {
        Self(error.into())
    }
}

/// Reads frames and what their colours show.
fn panels(
    trajectory: &Trajectory,
    quantity: Quantity,
    chosen: &[usize],
) -> miette::Result<Vec<Panel>> {
    let start = quantity::Start::read(trajectory, quantity)?;
    chosen.iter().map(|&index| Ok(Panel::new(trajectory.frame(index)?, &start))).collect()
}
