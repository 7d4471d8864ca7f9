//! Trajectory files as sources of positions.

use std::path::{Path, PathBuf};

use dempm::scene::Scene;
use dempm::trajectory::{Header, Trajectory};

use super::DataError;
use crate::constraints::Constraints;
use crate::features::Obstacle;
use crate::node_features::{NodeFeature, static_features};

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
}

impl Recording {
    /// Opens a trajectory file.
    ///
    /// # Errors
    /// If it is not a trajectory or damaged.
    pub fn open(path: &Path) -> Result<Self, DataError> {
        Ok(Self { trajectory: Trajectory::open(path)?, held: None })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        self.trajectory.path()
    }

    /// What the file says about its run.
    pub fn header(&self) -> &Header {
        self.trajectory.header()
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
