//! Trajectory files as sources of positions.

use std::path::{Path, PathBuf};

use dempm::scene::{Scene, SceneError};
use dempm::trajectory::{Header, Trajectory};

use super::DataError;
use crate::features::{Obstacle, static_features};
use crate::network::NodeFeature;
use crate::rollout::Constraints;

/// The trajectory files (`*.h5`) of a folder, sorted by name.
///
/// # Errors
/// If the folder cannot be listed or has none.
pub fn trajectories_in(folder: &Path) -> Result<Vec<PathBuf>, DataError> {
    let failed = |source| DataError::Folder { path: folder.to_owned(), source };
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.extension().is_some_and(|suffix| suffix == "h5") {
            paths.push(path);
        }
    }
    if paths.is_empty() {
        return Err(DataError::Empty { path: folder.to_owned() });
    }
    paths.sort();
    Ok(paths)
}

/// The files of a training: those in `train/` and `valid/`, or all in the folder itself.
#[derive(Clone, Debug, PartialEq)]
pub struct DataFolder {
    /// Files to learn from.
    pub train: Vec<PathBuf>,
    /// Files whose rollouts select the best model; may be none.
    pub valid: Vec<PathBuf>,
}

impl DataFolder {
    /// Lists the files.
    ///
    /// # Errors
    /// If a folder cannot be listed or has no trajectories.
    pub fn open(folder: &Path) -> Result<Self, DataError> {
        let [train, valid] = ["train", "valid"].map(|name| folder.join(name));
        let train = trajectories_in(if train.is_dir() { &train } else { folder })?;
        let valid = if valid.is_dir() { trajectories_in(&valid)? } else { Vec::new() };
        Ok(Self { train, valid })
    }
}

/// Position (m) of a point at `x` (m) after a time (s; negative for before) at constant velocity `v`
/// (m/s).
pub fn extrapolate(x: [f64; 2], v: [f64; 2], time: f64) -> [f64; 2] {
    [0, 1].map(|k| x[k] + v[k] * time)
}

/// A trajectory file, with its positions in memory or on disk.
pub struct Recording {
    trajectory: Trajectory,
    /// All positions, if they are in memory.
    cache: Option<Vec<f64>>,
    /// Positions (m) and velocities (m/s) in the first frame, if they were read.
    first: Vec<([f64; 2], [f64; 2])>,
}

impl Recording {
    /// Opens a trajectory file.
    ///
    /// # Errors
    /// If it is not a trajectory or damaged.
    pub fn open(path: &Path) -> Result<Self, DataError> {
        Ok(Self { trajectory: Trajectory::open(path)?, cache: None, first: Vec::new() })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        self.trajectory.path()
    }

    /// Header of the file.
    pub fn header(&self) -> &Header {
        self.trajectory.header()
    }

    /// Status of its run, `finished` or why it ended.
    pub fn status(&self) -> &str {
        self.trajectory.status()
    }

    /// The number of frames.
    pub fn frames(&self) -> usize {
        self.trajectory.frames()
    }

    /// The number of frames up to the first at rest, which those after it repeat.
    pub fn frames_until_rest(&self) -> usize {
        let rest = self.trajectory.rest_time().unwrap_or(f64::INFINITY);
        self.trajectory.time().partition_point(|&time| time < rest) + 1
    }

    /// The number of material points.
    pub fn points(&self) -> usize {
        self.trajectory.points().mass.len()
    }

    /// Size of its positions in memory, bytes.
    pub fn bytes(&self) -> usize {
        self.frames() * self.values() * size_of::<f64>()
    }

    /// Coordinates of one frame.
    fn values(&self) -> usize {
        2 * self.points()
    }

    /// Reads all positions into memory.
    ///
    /// # Errors
    /// If the data are damaged or not finite.
    pub fn cache(&mut self) -> Result<(), DataError> {
        let mut all = Vec::with_capacity(self.frames() * self.values());
        for frame in 0..self.frames() {
            all.extend(self.read(frame)?);
        }
        self.cache = Some(all);
        Ok(())
    }

    /// The scene of the run.
    ///
    /// # Errors
    /// If the scene in the file is invalid.
    fn scene(&self) -> Result<Scene, SceneError> {
        Scene::parse(&self.header().scene, &format!("{}, scene", self.path().display()))
    }

    /// The boxes of its scene in the first frame; `interval` is the time between frames of a window, s.
    ///
    /// # Errors
    /// If the scene in the file is invalid.
    pub fn obstacles(&self, interval: f64) -> Result<Vec<Obstacle>, DataError> {
        let start = self.trajectory.time().first().copied().unwrap_or(0.0);
        Ok(Constraints::new(&self.scene()?).obstacles(start, interval))
    }

    /// Reads the first frame for [`positions_before`](Self::positions_before).
    ///
    /// # Errors
    /// If the data are damaged or not finite.
    pub fn read_first(&mut self) -> Result<(), DataError> {
        let positions = self.positions(0)?;
        let first = self.trajectory.frame(0)?;
        if let Some(point) = first.velocity.iter().position(|v| !v.iter().all(|v| v.is_finite())) {
            return Err(DataError::NotFinite { path: self.path().to_owned(), frame: 0, point });
        }
        let positions = positions.as_chunks().0.iter().copied();
        self.first = positions.zip(first.velocity).collect();
        Ok(())
    }

    /// Positions `frames` frames before the first one, extrapolated at its velocities; empty unless
    /// they were [read](Self::read_first).
    pub fn positions_before(&self, frames: usize) -> Vec<f64> {
        let time = -(frames as f64 * self.header().frame_interval);
        self.first.iter().flat_map(|&(x, v)| extrapolate(x, v, time)).collect()
    }

    /// Positions of one frame (m), x and y of the points in turn.
    ///
    /// # Errors
    /// If the data are damaged or not finite.
    pub fn positions(&self, frame: usize) -> Result<Vec<f64>, DataError> {
        match &self.cache {
            Some(all) => Ok(all[frame * self.values()..][..self.values()].to_vec()),
            None => self.read(frame),
        }
    }

    /// Static features of the points, points x columns.
    ///
    /// # Errors
    /// If the first frame cannot be read or lacks a field, or the scene in the file is invalid.
    pub fn static_features(&self, features: &[NodeFeature]) -> Result<Vec<f32>, DataError> {
        if !features.iter().any(|feature| feature.is_static()) {
            return Ok(Vec::new());
        }
        static_features(features, &self.trajectory.frame(0)?, &self.scene()?)
            .map_err(|source| DataError::Field { path: self.path().to_owned(), source })
    }

    fn read(&self, frame: usize) -> Result<Vec<f64>, DataError> {
        let positions = self.trajectory.positions(frame..frame + 1)?;
        let positions = positions.into_raw_vec_and_offset().0;
        match positions.iter().position(|x| !x.is_finite()) {
            None => Ok(positions),
            Some(place) => {
                Err(DataError::NotFinite { path: self.path().to_owned(), frame, point: place / 2 })
            }
        }
    }
}
