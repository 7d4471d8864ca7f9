//! Animations of a trajectory.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use files::{WriteError, write_atomically};
use image::RgbImage;
use plot::{Gif, Palette};
use rayon::prelude::*;

use super::bodies::Bodies;
use super::error::FigureError;
use super::figure::{Figure, Panel};
use super::options::Options;
use super::panels::panels;
use super::quantity::Evaluator;
use super::select;
use super::undrawn::Undrawn;
use super::view::View;
use crate::trajectory::Trajectory;

/// Frames drawn at a time, on all cores.
const BATCH: usize = 32;
/// Hundredths of a second that the last frame of a GIF stands before it begins again.
const LAST_FRAME: u16 = 200;
/// Frames that determine the range of the colours.
const SAMPLES: usize = 60;

/// Writes an animation of the selected frames, by default all: a GIF, or an MP4 by ffmpeg. Returns the
/// points left out.
///
/// # Errors
/// If a frame or its field is missing, ffmpeg fails or the file cannot be written.
pub fn animate(
    trajectory: &Trajectory,
    options: &Options,
    fps: u32,
    output: &Path,
) -> Result<Undrawn, FigureError> {
    let is_gif = match output.extension().and_then(|suffix| suffix.to_str()) {
        Some("gif") => true,
        Some("mp4") => false,
        _ => return Err(FigureError::AnimationFormat { path: output.to_owned() }),
    };
    let bodies = Bodies::of(trajectory, options.grains)?;
    let chosen = select::frames(&bodies, &options.frames)?.unwrap_or_else(|| select::all(&bodies));
    let (figure, undrawn) = layout(&bodies, options, &chosen)?;
    write_atomically(output, |temporary| {
        if is_gif {
            let mut palette = Palette::new(figure.scale());
            let file = File::create(temporary).map_err(WriteError::at(output, "write it"))?;
            // GIF counts in hundredths of a second.
            let delay = (100.0 / f64::from(fps)).round().max(2.0) as u16;
            let mut gif = Gif::new(BufWriter::new(file), figure.size(), palette.colours(), delay)?;
            draw_all(&bodies, options, &figure, &chosen, |image| {
                Ok(gif.push(palette.indexed(image))?)
            })?;
            gif.hold(LAST_FRAME)?;
            Ok(gif.finish()?)
        } else {
            let mut ffmpeg = Ffmpeg::start(temporary, figure.size(), fps)?;
            draw_all(&bodies, options, &figure, &chosen, |image| ffmpeg.push(image))?;
            ffmpeg.finish()
        }
    })?;
    Ok(undrawn)
}

/// A layout for one panel in which all frames fit, and the points that it leaves out.
fn layout(
    bodies: &Bodies<'_>,
    options: &Options,
    chosen: &[usize],
) -> Result<(Figure, Undrawn), FigureError> {
    let mut view = View::EMPTY;
    let mut undrawn = Undrawn::default();
    for &index in chosen {
        let frame = bodies.frame(index)?;
        view.include(&frame);
        undrawn.add(index, &frame);
    }
    let samples: Vec<usize> =
        select::evenly(chosen.len(), SAMPLES).into_iter().map(|place| chosen[place]).collect();
    let samples = panels(bodies, options.quantity, &samples)?;
    let width = options.width.unwrap_or(960);
    let figure = Figure::with_view(bodies, options, &samples, view, 1, width);
    Ok((figure, undrawn))
}

/// Draws frames on all cores and passes the images on in order.
fn draw_all(
    bodies: &Bodies<'_>,
    options: &Options,
    figure: &Figure,
    chosen: &[usize],
    mut push: impl FnMut(&RgbImage) -> Result<(), FigureError>,
) -> Result<(), FigureError> {
    let evaluator = Evaluator::new(bodies, options.quantity)?;
    for batch in chosen.chunks(BATCH) {
        let images: Vec<Result<RgbImage, FigureError>> = batch
            .par_iter()
            .map(|&index| figure.draw(&[Panel::new(bodies.frame(index)?, &evaluator)]))
            .collect();
        for image in images {
            push(&image?)?;
        }
    }
    Ok(())
}

/// The program ffmpeg, which encodes MP4 files.
struct Ffmpeg {
    process: Child,
}

impl Ffmpeg {
    fn start(path: &Path, (width, height): (u32, u32), fps: u32) -> Result<Self, FigureError> {
        let mut command = Command::new("ffmpeg");
        command
            .args(["-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"])
            .args(["-s", &format!("{width}x{height}"), "-r", &fps.to_string(), "-i", "-"])
            .args(["-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "18"])
            .args(["-movflags", "+faststart", "-f", "mp4"])
            .arg(path);
        let process = command.stdin(Stdio::piped()).stdout(Stdio::null()).spawn();
        let process = process.map_err(FigureError::NoFfmpeg)?;
        Ok(Self { process })
    }

    fn push(&mut self, image: &RgbImage) -> Result<(), FigureError> {
        let input = self.process.stdin.as_mut().expect("the input is open until the end");
        input.write_all(image.as_raw()).map_err(FigureError::FfmpegStopped)
    }

    fn finish(mut self) -> Result<(), FigureError> {
        drop(self.process.stdin.take());
        let status = self.process.wait().map_err(FigureError::FfmpegStopped)?;
        if !status.success() {
            return Err(FigureError::FfmpegFailed(status));
        }
        Ok(())
    }
}
