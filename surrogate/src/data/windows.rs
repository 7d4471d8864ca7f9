//! Windows of frames, each with the frame that follows.

use std::path::PathBuf;

use super::{DataError, Recording};
use crate::features::Obstacle;
use crate::network::NodeFeature;

/// Shape of the windows of a data set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WindowShape {
    /// Frames of a window.
    pub frames: usize,
    /// Frames of the file per frame of a window: 1, 2, 3, 6 and 10 give the paper's data sets 1 to
    /// 5. Windows start at every frame of the file, so a coarse data set consists of interleaved
    /// trajectories and has about as many windows as the finest.
    pub stride: usize,
    /// Largest number of frames of a window before the first frame of the file.
    pub before: usize,
}

impl WindowShape {
    /// Frames of the file from the first of a window to its target.
    fn span(self) -> usize {
        self.frames * self.stride
    }

    /// Frames of the file by which the first window begins early.
    pub(super) fn ahead(self) -> usize {
        self.before * self.stride
    }
}

/// A window and the frame that follows. Positions are in m, x and y of the points in turn.
#[derive(Clone, Debug, PartialEq)]
pub struct Example {
    /// The number of material points.
    pub points: usize,
    /// Positions, frame by frame, the oldest first.
    pub positions: Vec<f64>,
    /// Positions in the frame after the window.
    pub next: Vec<f64>,
    /// Gravity, m/frame².
    pub gravity: [f64; 2],
    /// Static features of the points.
    pub statics: Vec<f32>,
    /// Boxes.
    pub obstacles: Vec<Obstacle>,
}

impl Example {
    /// Coordinates of one frame.
    pub fn values(&self) -> usize {
        2 * self.points
    }

    /// Second difference of the positions around the last frame, m/frame².
    pub fn acceleration(&self) -> Vec<f64> {
        let (before, last) = self.last_two();
        let rows = self.next.iter().zip(last).zip(before);
        rows.map(|((next, last), before)| (next - last) - (last - before)).collect()
    }

    /// Difference of the last two frames, m/frame.
    pub fn velocity(&self) -> Vec<f64> {
        let (before, last) = self.last_two();
        last.iter().zip(before).map(|(last, before)| last - before).collect()
    }

    /// The positions in single precision.
    pub fn window(&self) -> Vec<f32> {
        self.positions.iter().map(|&x| x as f32).collect()
    }

    /// Advances the window by a frame, with accelerations in m/frame².
    pub(super) fn advance(&mut self, acceleration: &[f64]) {
        let (before, last) = self.last_two();
        let moved = last.iter().zip(before).zip(acceleration);
        let moved: Vec<f64> = moved.map(|((x, before), a)| x + (x - before) + a).collect();
        self.positions.drain(..self.values());
        self.positions.extend(moved);
        self.obstacles.iter_mut().for_each(Obstacle::advance);
    }

    /// Keeps the first `frames` frames and the one after; returns all frames after them.
    pub(super) fn shorten(&mut self, frames: usize) -> Vec<f64> {
        let mut future = self.positions.split_off(frames * self.values());
        let removed = future.len() / self.values().max(1);
        self.obstacles.iter_mut().for_each(|obstacle| obstacle.elapsed -= removed as f64);
        future.append(&mut self.next);
        self.next = future[..self.values()].to_vec();
        future
    }

    /// The last two frames.
    pub(super) fn last_two(&self) -> (&[f64], &[f64]) {
        let (rest, last) = self.positions.split_at(self.positions.len() - self.values());
        (&rest[rest.len() - self.values()..], last)
    }
}

/// All windows of several trajectories.
///
/// Positions of the first files are cached as far as `memory` allows; those of the others are read
/// for every example.
pub struct DataSet {
    recordings: Vec<Recording>,
    shape: WindowShape,
    /// Windows of each file.
    windows: Vec<usize>,
    /// Static features of the points of each file.
    statics: Vec<Vec<f32>>,
    /// Boxes of each file, in its first frame.
    obstacles: Vec<Vec<Obstacle>>,
}

impl DataSet {
    /// Opens the files; `memory` is the size of the cache in bytes.
    ///
    /// # Errors
    /// If a file cannot be read, is too short for a window, or differs from the first in its domain
    /// or frame interval.
    pub fn open(paths: &[PathBuf], shape: WindowShape, memory: usize) -> Result<Self, DataError> {
        let mut recordings: Vec<Recording> = Vec::with_capacity(paths.len());
        let mut left = memory;
        for path in paths {
            let mut recording = Recording::open(path)?;
            let needed = shape.span() + 1 - shape.ahead();
            if recording.frames() < needed {
                return Err(DataError::TooShort {
                    path: path.clone(),
                    found: recording.frames(),
                    stride: shape.stride,
                    needed,
                });
            }
            if let Some(first) = recordings.first() {
                check_alike(first, &recording)?;
            }
            if shape.before > 0 {
                recording.read_first()?;
            }
            if let Some(rest) = left.checked_sub(recording.bytes()) {
                recording.cache()?;
                left = rest;
            }
            recordings.push(recording);
        }
        let statics = vec![Vec::new(); recordings.len()];
        let obstacles = vec![Vec::new(); recordings.len()];
        let windows = recordings.iter().map(|recording| windows(recording, shape)).collect();
        Ok(Self { recordings, shape, windows, statics, obstacles })
    }

    /// Reads the static features.
    ///
    /// # Errors
    /// If a file cannot be read or lacks a field that a feature needs.
    pub fn with_statics(mut self, features: &[NodeFeature]) -> Result<Self, DataError> {
        for (recording, statics) in self.recordings.iter().zip(&mut self.statics) {
            *statics = recording.static_features(features)?;
        }
        Ok(self)
    }

    /// Reads the boxes if the network sees them.
    ///
    /// # Errors
    /// If the scene in a file is invalid.
    pub fn with_obstacles(mut self, seen: bool) -> Result<Self, DataError> {
        if seen {
            let interval = self.frame_interval();
            for (recording, obstacles) in self.recordings.iter().zip(&mut self.obstacles) {
                *obstacles = recording.obstacles(interval)?;
            }
        }
        Ok(self)
    }

    /// The kind of material of all scenes; `None` if they differ.
    pub fn material(&self) -> Option<&str> {
        let mut kinds = self.recordings.iter().map(|file| file.header().material.as_str());
        let first = kinds.next()?;
        kinds.all(|kind| kind == first).then_some(first)
    }

    /// The number of windows.
    pub fn len(&self) -> usize {
        self.windows.iter().sum()
    }

    /// The number of windows of each file.
    pub(super) fn windows_of_files(&self) -> impl Iterator<Item = usize> {
        self.windows.iter().copied()
    }

    /// Points of each window.
    pub fn points(&self) -> Vec<usize> {
        let files = self.recordings.iter().zip(&self.windows);
        files.flat_map(|(file, &windows)| std::iter::repeat_n(file.points(), windows)).collect()
    }

    /// Whether there is no window; never with at least one file.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The files.
    pub fn recordings(&self) -> &[Recording] {
        &self.recordings
    }

    /// Static features of the points of each file.
    pub fn statics(&self) -> &[Vec<f32>] {
        &self.statics
    }

    /// Shape of the windows.
    pub fn shape(&self) -> WindowShape {
        self.shape
    }

    /// Time between frames of a window, s.
    pub fn frame_interval(&self) -> f64 {
        self.recordings.first().map_or(f64::NAN, |recording| {
            recording.header().frame_interval * self.shape.stride as f64
        })
    }

    /// Extent of the domain along x and y, m.
    pub fn bounds(&self) -> [[f64; 2]; 2] {
        let size = self.recordings.first().map_or([f64::NAN; 2], |r| r.header().domain);
        size.map(|length| [0.0, length])
    }

    /// Reads a window; windows are numbered through all files.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn example(&self, window: usize) -> Result<Example, DataError> {
        let mut first = window;
        let mut files = self.windows.iter().enumerate();
        let file = loop {
            let (file, windows) = files.next().expect("the window is one of the data set");
            match first.checked_sub(*windows) {
                Some(rest) => first = rest,
                None => break file,
            }
        };
        let recording = &self.recordings[file];
        let mut positions = Vec::new();
        for frame in 0..self.shape.frames {
            let place = first + frame * self.shape.stride;
            positions.extend(match place.checked_sub(self.shape.ahead()) {
                Some(frame) => recording.positions(frame)?,
                None => recording.positions_before(self.shape.ahead() - place),
            });
        }
        let next = recording.positions(first + self.shape.span() - self.shape.ahead())?;
        let interval = self.frame_interval();
        let gravity = recording.header().gravity.map(|g| g * interval * interval);
        let newest =
            (first + self.shape.span() - self.shape.stride) as f64 - self.shape.ahead() as f64;
        let newest = newest / self.shape.stride as f64;
        let at_newest = |&o: &Obstacle| Obstacle { elapsed: o.elapsed + newest, ..o };
        Ok(Example {
            points: recording.points(),
            positions,
            next,
            gravity,
            statics: self.statics[file].clone(),
            obstacles: self.obstacles[file].iter().map(at_newest).collect(),
        })
    }
}

/// Windows of a file. Frames that repeat a state at rest add one.
fn windows(recording: &Recording, shape: WindowShape) -> usize {
    let frames = recording.frames().min(recording.frames_until_rest() + shape.span());
    frames + shape.ahead() - shape.span()
}

fn check_alike(first: &Recording, other: &Recording) -> Result<(), DataError> {
    let (a, b) = (first.header(), other.header());
    let mixed = |what, found: String, expected: String| DataError::Mixed {
        path: other.path().to_owned(),
        other: first.path().to_owned(),
        what,
        found,
        expected,
    };
    if a.domain != b.domain {
        return Err(mixed("the domain", format!("{:?} m", b.domain), format!("{:?} m", a.domain)));
    }
    if a.frame_interval != b.frame_interval {
        return Err(mixed(
            "the time between frames",
            format!("{} s", b.frame_interval),
            format!("{} s", a.frame_interval),
        ));
    }
    Ok(())
}
