//! A trajectory as a film.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use files::write_atomically;
use image::RgbImage;
use miette::{IntoDiagnostic, WrapErr, bail, miette};
use plot::{Gif, Palette};
use rayon::prelude::*;

use super::figure::{Figure, Panel};
use super::view::View;
use super::{PictureError, PlotArgs, panels, quantity, select};
use crate::trajectory::Trajectory;

/// Frames that are drawn at a time, on all cores.
const BATCH: usize = 32;
/// Hundredths of a second that the last frame of a GIF stands before it begins again.
const LAST_FRAME: u16 = 200;
/// Frames from which the range of the colours is taken.
const SAMPLES: usize = 60;

/// Draws the chosen frames, or all, one after the other.
pub(super) fn animate(
    trajectory: &Trajectory,
    args: &PlotArgs,
    output: &Path,
) -> miette::Result<()> {
    let is_gif = match output.extension().and_then(|suffix| suffix.to_str()) {
        Some("gif") => true,
        Some("mp4") => false,
        _ => bail!("{}: an animation is a .gif or an .mp4 file", output.display()),
    };
    let chosen =
        select::frames(trajectory, args)?.unwrap_or_else(|| (0..trajectory.frames()).collect());
    let figure = layout(trajectory, args, &chosen)?;
    let write = |temporary: &Path| -> miette::Result<()> {
        if is_gif {
            let mut palette = Palette::new(figure.scale());
            let file = BufWriter::new(File::create(temporary).into_diagnostic()?);
            // GIF counts in hundredths of a second.
            let delay = (100.0 / f64::from(args.fps)).round().max(2.0) as u16;
            let mut gif = Gif::new(file, figure.size(), palette.colours(), delay)?;
            draw_all(trajectory, args, &figure, &chosen, |image| {
                Ok(gif.push(palette.indexed(image))?)
            })?;
            gif.hold(LAST_FRAME)?;
            Ok(gif.finish()?)
        } else {
            let mut ffmpeg = Ffmpeg::start(temporary, figure.size(), args.fps)?;
            draw_all(trajectory, args, &figure, &chosen, |image| ffmpeg.push(image))?;
            ffmpeg.finish()
        }
    };
    write_atomically(output, |temporary| write(temporary).map_err(PictureError))
        .map_err(|PictureError(report)| report)
        .wrap_err_with(|| format!("cannot write {}", output.display()))
}

/// A layout for single pictures in which the whole film fits.
fn layout(trajectory: &Trajectory, args: &PlotArgs, chosen: &[usize]) -> miette::Result<Figure> {
    let mut view = View::EMPTY;
    for &index in chosen {
        view.include(&trajectory.frame(index)?);
    }
    let samples: Vec<usize> =
        select::evenly(chosen.len(), SAMPLES).into_iter().map(|place| chosen[place]).collect();
    let samples = panels(trajectory, args.field, &samples)?;
    let width = args.width.unwrap_or(960);
    Ok(Figure::with_view(trajectory.header(), args, &samples, view, 1, width))
}

/// Draws frames on all cores and hands the pictures on in order.
fn draw_all(
    trajectory: &Trajectory,
    args: &PlotArgs,
    figure: &Figure,
    chosen: &[usize],
    mut push: impl FnMut(&RgbImage) -> miette::Result<()>,
) -> miette::Result<()> {
    let start = quantity::Start::read(trajectory, args.field)?;
    for batch in chosen.chunks(BATCH) {
        let images: Vec<miette::Result<RgbImage>> = batch
            .par_iter()
            .map(|&index| figure.draw(&[Panel::new(trajectory.frame(index)?, &start)]))
            .collect();
        for image in images {
            push(&image?)?;
        }
    }
    Ok(())
}

/// The program that makes MP4 files, if it is installed.
struct Ffmpeg {
    process: Child,
}

impl Ffmpeg {
    fn start(path: &Path, (width, height): (u32, u32), fps: u32) -> miette::Result<Self> {
        let mut command = Command::new("ffmpeg");
        command
            .args(["-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"])
            .args(["-s", &format!("{width}x{height}"), "-r", &fps.to_string(), "-i", "-"])
            .args(["-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "18"])
            .args(["-movflags", "+faststart", "-f", "mp4"])
            .arg(path);
        let process = command.stdin(Stdio::piped()).stdout(Stdio::null()).spawn();
        let process = process.map_err(|error| {
            miette!(
                help = "install ffmpeg, or name a .gif file, which needs nothing else",
                "MP4 needs the program ffmpeg, which does not start: {error}"
            )
        })?;
        Ok(Self { process })
    }

    fn push(&mut self, image: &RgbImage) -> miette::Result<()> {
        let input = self.process.stdin.as_mut().ok_or_else(|| miette!("ffmpeg has no input"))?;
        input.write_all(image.as_raw()).into_diagnostic().wrap_err("ffmpeg stopped early")
    }

    fn finish(mut self) -> miette::Result<()> {
        drop(self.process.stdin.take());
        let status = self.process.wait().into_diagnostic()?;
        if !status.success() {
            bail!("ffmpeg failed ({status})");
        }
        Ok(())
    }
}
