//! `dempm plot`: draws or animates trajectories, and charts the paths of element tests.

use std::path::{Path, PathBuf};

use files::{announce, note, refuse_input, refuse_same};
use miette::{Report, WrapErr, bail};

use crate::figures::{
    Average, Compare, FigureError, Options, Quantity, Selection, Undrawn, animate, draw, draw_paths,
};
use crate::trajectory::Trajectory;

/// The arguments of `dempm plot`.
#[derive(clap::Args, Clone, Debug)]
pub struct PlotArgs {
    /// Trajectory files, of which the others are compared with the first, or paths of element tests (CSV)
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// The figure to write (PNG) [default: the first FILE with suffix .png; of several trajectories, their names
    /// joined by -and-]
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
    /// The quantity that the colours show [default: speed; layer with --grains; the distance in differences]
    #[arg(long, value_enum)]
    pub field: Option<Quantity>,
    /// Show means of the quantity: stresses of single points scatter
    #[arg(long, value_enum, value_name = "OVER")]
    pub average: Option<Average>,
    /// How several trajectories share a picture
    #[arg(long, value_enum, default_value_t = Compare::Side)]
    pub compare: Compare,
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
        Options {
            grains: self.grains,
            quantity: self.field,
            average: self.average,
            log: self.log,
            frames,
            width: self.width,
            compare: self.compare,
        }
    }

    /// The picture to write. Without an explicit -o, an animation comes without one.
    fn figure(&self) -> Option<PathBuf> {
        match (&self.output, &self.animate) {
            (Some(output), _) => Some(output.clone()),
            (None, None) => Some(default_figure(&self.files)),
            (None, Some(_)) => None,
        }
    }
}

/// The first file with the suffix `.png`; of several the names of all, joined.
fn default_figure(files: &[PathBuf]) -> PathBuf {
    let stem = |file: &PathBuf| file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let names: Vec<String> = files.iter().map(stem).collect();
    // Not `with_extension`: a name may have a dot of its own.
    files[0].with_file_name(names.join("-and-") + ".png")
}

/// Draws or animates trajectories, or charts paths, and prints the names of the files.
///
/// # Errors
/// If a file cannot be read, has no such frames or fields, or an output cannot be written.
pub fn plot(args: &PlotArgs) -> miette::Result<()> {
    let figure = args.figure();
    let outputs: Vec<&Path> =
        args.animate.iter().chain(figure.as_ref()).map(PathBuf::as_path).collect();
    refuse_same(&outputs)?;
    for output in &outputs {
        refuse_input(output, &args.files)?;
    }
    let is_path = |file: &&PathBuf| file.extension().is_some_and(|suffix| suffix == "csv");
    match args.files.iter().filter(is_path).count() {
        0 => plot_trajectories(args, figure.as_deref()),
        paths if paths < args.files.len() => {
            bail!("paths of element tests (CSV) and trajectories do not share a picture")
        }
        _ => plot_paths(args, figure.as_deref()),
    }
}

fn plot_paths(args: &PlotArgs, figure: Option<&Path>) -> miette::Result<()> {
    let (Some(output), None) = (figure, &args.animate) else {
        bail!("--animate: a path of an element test is a chart");
    };
    draw_paths(&args.files, args.width.unwrap_or(1600), output)
        .map_err(Report::new)
        .wrap_err_with(|| format!("cannot draw {}", output.display()))?;
    announce!("{}", output.display());
    Ok(())
}

fn plot_trajectories(args: &PlotArgs, figure: Option<&Path>) -> miette::Result<()> {
    let open = |path: &PathBuf| {
        let trajectory = Trajectory::open(path)?;
        match trajectory.frames() {
            0 => Err(FigureError::Empty { path: path.clone() }),
            _ => Ok(trajectory),
        }
    };
    let trajectories: Vec<Trajectory> =
        args.files.iter().map(open).collect::<Result<_, FigureError>>()?;
    let options = args.options();
    if let Some(output) = &args.animate {
        told(output, animate(&trajectories, &options, args.fps, output))?;
    }
    if let Some(output) = figure {
        told(output, draw(&trajectories, &options, output))?;
    }
    Ok(())
}

/// Prints the name of a picture and what it leaves out.
fn told(output: &Path, undrawn: Result<Undrawn, FigureError>) -> miette::Result<()> {
    let undrawn = undrawn
        .map_err(Report::new)
        .wrap_err_with(|| format!("cannot draw {}", output.display()))?;
    if let Some((frame, point)) = undrawn.first {
        note!(
            "{}: {} positions are not finite and not drawn, the first at frame {frame}, point {point}",
            output.display(),
            undrawn.count
        );
    }
    for name in &undrawn.unlike {
        note!("{name} does not start with the material of the first run: no distance between them");
    }
    announce!("{}", output.display());
    Ok(())
}
