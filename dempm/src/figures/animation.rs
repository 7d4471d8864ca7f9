//! Animations of trajectories.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use files::{WriteError, write_atomically};
use image::RgbImage;
use plot::{Gif, Palette};
use rayon::prelude::*;

use super::error::FigureError;
use super::figure::Figure;
use super::options::Options;
use super::panels::panels;
use super::select;
use super::shown::Shown;
use super::undrawn::Undrawn;
use super::view::View;
use crate::trajectory::Trajectory;

/// Frames drawn at a time, on all cores.
const BATCH: usize = 32;
/// Hundredths of a second that the last frame of a GIF stands before it begins again.
const LAST_FRAME: u16 = 200;
/// Frames that determine the range of the colours.
const SAMPLES: usize = 60;

/// Writes an animation of the selected frames, by default all, of one run or of several in comparison with the
/// first: a GIF, or an MP4 by ffmpeg.
///
/// # Errors
/// If a frame or its field is missing, the runs cannot be compared, ffmpeg fails or the file cannot be written.
pub fn animate(
    trajectories: &[Trajectory],
    options: &Options,
    fps: u32,
    output: &Path,
) -> Result<Undrawn, FigureError> {
    let is_gif = match output.extension().and_then(|suffix| suffix.to_str()) {
        Some("gif") => true,
        Some("mp4") => false,
        _ => return Err(FigureError::AnimationFormat { path: output.to_owned() }),
    };
    let shown = Shown::new(trajectories, options)?;
    let chosen = select::places(&shown, &options.frames)?
        .unwrap_or_else(|| (0..shown.frames.len()).collect());
    let (figure, undrawn) = layout(&shown, options, &chosen)?;
    write_atomically(output, |temporary| {
        if is_gif {
            let (scale, others) = figure.colours();
            let mut palette = Palette::new(&scale, &others);
            let file = File::create(temporary).map_err(WriteError::at(output, "write it"))?;
            // GIF counts in hundredths of a second.
            let delay = (100.0 / f64::from(fps)).round().max(2.0) as u16;
            let mut gif = Gif::new(BufWriter::new(file), figure.size(), palette.colours(), delay)?;
            draw_all(&shown, &figure, &chosen, |image| Ok(gif.push(palette.indexed(image))?))?;
            gif.hold(LAST_FRAME)?;
            Ok(gif.finish()?)
        } else {
            let mut ffmpeg = Ffmpeg::start(temporary, figure.size(), fps)?;
            draw_all(&shown, &figure, &chosen, |image| ffmpeg.push(image))?;
            ffmpeg.finish()
        }
    })?;
    Ok(undrawn)
}

/// A figure of one time in which all frames fit, and what it leaves out.
fn layout(
    shown: &Shown<'_>,
    options: &Options,
    chosen: &[usize],
) -> Result<(Figure, Undrawn), FigureError> {
    let (mut view, mut undrawn) = (View::EMPTY, Undrawn::unlike(&shown.unlike()));
    for &place in chosen {
        shown.look(place, &mut view, &mut undrawn)?;
    }
    let samples: Vec<usize> =
        select::evenly(chosen.len(), SAMPLES).into_iter().map(|place| chosen[place]).collect();
    let samples = panels(shown, &samples)?;
    let width = options.width.unwrap_or(960);
    let figure = Figure::new(shown, options, &samples, view, shown.panels_a_time(), width);
    Ok((figure, undrawn))
}

/// Draws frames on all cores and passes the images on in order.
fn draw_all(
    shown: &Shown<'_>,
    figure: &Figure,
    chosen: &[usize],
    mut push: impl FnMut(&RgbImage) -> Result<(), FigureError>,
) -> Result<(), FigureError> {
    for batch in chosen.chunks(BATCH) {
        let images: Vec<Result<RgbImage, FigureError>> = batch
            .par_iter()
            .map(|&place| figure.draw(&shown.panels(place)?, &[shown.time(place)]))
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
