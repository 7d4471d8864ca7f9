//! Windows of frames, each with the frame that follows it.

use std::path::PathBuf;

use super::{DataError, Recording};
use crate::features::Obstacle;
use crate::node_features::NodeFeature;

/// What a window is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Frames that the model sees.
    pub frames: usize,
    /// Frames of the file from one frame of a window to the next: 1, 2, 3, 6 and 10 give the
    /// paper's data sets 1 to 5. Windows start at every frame of the file, so a coarser data set
    /// is cut into interleaved trajectories and has about as many windows as the finest.
    pub stride: usize,
    /// Frames of a window that may be from before the first of the file, at most.
    pub before: usize,
}

impl Shape {
    /// Frames of the file from the first of a window to its target.
    fn span(self) -> usize {
        self.frames * self.stride
    }

    /// How far before the first frame of the file the first window begins.
    fn ahead(self) -> usize {
        self.before * self.stride
    }
}

/// A window and the frame after it. Positions are in m, x and y of the points in turn.
#[derive(Clone, Debug, PartialEq)]
pub struct Example {
    /// The number of material points.
    pub points: usize,
    /// Frame after frame, the oldest first.
    pub positions: Vec<f64>,
    /// The frame after the last one.
    pub next: Vec<f64>,
    /// Gravity, m/frame².
    pub gravity: [f64; 2],
    /// Features of the points that never change.
    pub statics: Vec<f32>,
    /// Fixed boxes.
    pub obstacles: Vec<Obstacle>,
}

impl Example {
    /// Numbers in one frame.
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

    /// The positions as a model gets them.
    pub fn window(&self) -> Vec<f32> {
        self.positions.iter().map(|&x| x as f32).collect()
    }

    /// Moves the window on by a frame, with accelerations in m/frame².
    pub(super) fn advance(&mut self, acceleration: &[f64]) {
        let (before, last) = self.last_two();
        let moved = last.iter().zip(before).zip(acceleration);
        let moved: Vec<f64> = moved.map(|((x, before), a)| x + (x - before) + a).collect();
        self.positions.drain(..self.values());
        self.positions.extend(moved);
    }

    /// Keeps the first `frames` frames and the one after them; gives all frames after them.
    pub(super) fn shorten(&mut self, frames: usize) -> Vec<f64> {
        let mut future = self.positions.split_off(frames * self.values());
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
/// Positions of the first files are held in memory as far as `memory` allows; windows of the other
/// files are read from the disk whenever they are asked for.
pub struct DataSet {
    recordings: Vec<Recording>,
    shape: Shape,
    /// Features that never change, of the points of each file.
    statics: Vec<Vec<f32>>,
    /// Obstacles of each file.
    obstacles: Vec<Vec<Obstacle>>,
}

impl DataSet {
    /// Opens the files and checks that they belong together; `memory` is in bytes.
    ///
    /// # Errors
    /// If a file cannot be read, is too short for a window or differs from the first in its domain
    /// or the time between frames.
    pub fn open(paths: &[PathBuf], shape: Shape, memory: usize) -> Result<Self, DataError> {
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
                recording.hold_start()?;
            }
            if let Some(rest) = left.checked_sub(recording.bytes()) {
                recording.hold()?;
                left = rest;
            }
            recordings.push(recording);
        }
        let statics = vec![Vec::new(); recordings.len()];
        let obstacles = vec![Vec::new(); recordings.len()];
        Ok(Self { recordings, shape, statics, obstacles })
    }

    /// Reads the features that never change.
    ///
    /// # Errors
    /// If a file cannot be read or lacks a field that a feature needs.
    pub fn with_statics(mut self, features: &[NodeFeature]) -> Result<Self, DataError> {
        for (recording, statics) in self.recordings.iter().zip(&mut self.statics) {
            *statics = recording.static_features(features)?;
        }
        Ok(self)
    }

    /// Reads the obstacles, if a network sees them.
    ///
    /// # Errors
    /// If a file does not say what its scene was.
    pub fn with_obstacles(mut self, seen: bool) -> Result<Self, DataError> {
        if seen {
            for (recording, obstacles) in self.recordings.iter().zip(&mut self.obstacles) {
                *obstacles = recording.obstacles()?;
            }
        }
        Ok(self)
    }

    /// The number of windows.
    pub fn len(&self) -> usize {
        self.recordings.iter().map(|recording| self.windows(recording)).sum()
    }

    /// Points of each window.
    pub fn points(&self) -> Vec<usize> {
        let windows = |file: &Recording| std::iter::repeat_n(file.points(), self.windows(file));
        self.recordings.iter().flat_map(windows).collect()
    }

    /// Whether there is no window; a data set of at least one file has some.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The files.
    pub fn recordings(&self) -> &[Recording] {
        &self.recordings
    }

    /// Features that never change, of the points of each file.
    pub fn statics(&self) -> &[Vec<f32>] {
        &self.statics
    }

    /// What windows are made of.
    pub fn shape(&self) -> Shape {
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

    /// Reads a window, counted through all files.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn example(&self, window: usize) -> Result<Example, DataError> {
        let mut first = window;
        let mut files = self.recordings.iter().zip(&self.statics).zip(&self.obstacles);
        let ((recording, statics), obstacles) = loop {
            let file = files.next().expect("the window is one of the data set");
            match first.checked_sub(self.windows(file.0.0)) {
                Some(rest) => first = rest,
                None => break file,
            }
        };
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
        Ok(Example {
            points: recording.points(),
            positions,
            next,
            gravity,
            statics: statics.clone(),
            obstacles: obstacles.clone(),
        })
    }

    fn windows(&self, recording: &Recording) -> usize {
        recording.frames() + self.shape.ahead() - self.shape.span()
    }
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
