//! Trajectory files as sources of positions.

use std::path::{Path, PathBuf};

use dempm::scene::Scene;
use dempm::trajectory::{Header, Trajectory};

use super::DataError;
use crate::constraints::Constraints;
use crate::features::Obstacle;
use crate::node_features::{NodeFeature, static_features};
use crate::start::moved;

/// The trajectory files (`*.h5`) of a folder, by name.
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

/// The files of a training: those in `train/` and `valid/`, or all of a folder without the two.
#[derive(Clone, Debug, PartialEq)]
pub struct DataFolder {
    /// Files to learn from.
    pub train: Vec<PathBuf>,
    /// Files whose rollouts choose the best model; may be none.
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

/// A trajectory file, its positions in memory or read as they are asked for.
pub struct Recording {
    trajectory: Trajectory,
    held: Option<Vec<f64>>,
    /// Positions (m) and velocities (m/s) in the first frame, if they were asked for.
    start: Vec<([f64; 2], [f64; 2])>,
}

impl Recording {
    /// Opens a trajectory file.
    ///
    /// # Errors
    /// If it is not a trajectory or damaged.
    pub fn open(path: &Path) -> Result<Self, DataError> {
        Ok(Self { trajectory: Trajectory::open(path)?, held: None, start: Vec::new() })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        self.trajectory.path()
    }

    /// What the file says about its run.
    pub fn header(&self) -> &Header {
        self.trajectory.header()
    }

    /// `finished`, or what became of its run.
    pub fn status(&self) -> &str {
        self.trajectory.status()
    }

    /// The number of frames.
    pub fn frames(&self) -> usize {
        self.trajectory.frames()
    }

    /// The number of material points.
    pub fn points(&self) -> usize {
        self.trajectory.points().mass.len()
    }

    /// Bytes that its positions take in memory.
    pub fn bytes(&self) -> usize {
        self.frames() * self.values() * size_of::<f64>()
    }

    /// Numbers in one frame.
    fn values(&self) -> usize {
        2 * self.points()
    }

    /// Reads all positions into memory.
    ///
    /// # Errors
    /// If the data are damaged or not finite.
    pub fn hold(&mut self) -> Result<(), DataError> {
        let mut all = Vec::with_capacity(self.frames() * self.values());
        for frame in 0..self.frames() {
            all.extend(self.read(frame)?);
        }
        self.held = Some(all);
        Ok(())
    }

    /// The obstacles of its scene.
    ///
    /// # Errors
    /// If the scene in the file is none.
    pub fn obstacles(&self) -> Result<Vec<Obstacle>, DataError> {
        let place = format!("{}, scene", self.path().display());
        let scene = Scene::parse(&self.header().scene, &place)?;
        Ok(Constraints::new(&scene).obstacles())
    }

    /// Reads what [`positions_before`](Self::positions_before) needs.
    ///
    /// # Errors
    /// If the data are damaged or not finite.
    pub fn hold_start(&mut self) -> Result<(), DataError> {
        let positions = self.positions(0)?;
        let first = self.trajectory.frame(0)?;
        if let Some(point) = first.velocity.iter().position(|v| !v.iter().all(|v| v.is_finite())) {
            return Err(DataError::NotFinite { path: self.path().to_owned(), frame: 0, point });
        }
        let positions = positions.as_chunks().0.iter().copied();
        self.start = positions.zip(first.velocity).collect();
        Ok(())
    }

    /// Positions so many frames before the first one, in which every point moves as it does in that
    /// one: those of [`hold_start`](Self::hold_start), or none.
    pub fn positions_before(&self, frames: usize) -> Vec<f64> {
        let time = -(frames as f64 * self.header().frame_interval);
        self.start.iter().flat_map(|&(x, v)| moved(x, v, time)).collect()
    }

    /// Positions of one frame, m: x and y of the points in turn.
    ///
    /// # Errors
    /// If the data are damaged or not finite.
    pub fn positions(&self, frame: usize) -> Result<Vec<f64>, DataError> {
        match &self.held {
            Some(all) => Ok(all[frame * self.values()..][..self.values()].to_vec()),
            None => self.read(frame),
        }
    }

    /// Features of the points that never change.
    ///
    /// # Errors
    /// If the first frame cannot be read or lacks a field.
    pub fn static_features(&self, features: &[NodeFeature]) -> Result<Vec<f32>, DataError> {
        if !features.iter().any(|feature| feature.is_static()) {
            return Ok(Vec::new());
        }
        static_features(features, &self.trajectory.frame(0)?)
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
