//! Data sets on disk: folders `train`, `valid` and `test` of trajectories.

use std::path::{Path, PathBuf};

use super::error::DatasetError;
use crate::trajectory::Trajectory;

/// The parts of a data set.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Split {
    /// Trajectories to fit a model to.
    Train,
    /// Trajectories to choose a model by.
    Valid,
    /// Trajectories to assess the chosen model.
    Test,
}

impl Split {
    /// All splits in order.
    pub const ALL: [Self; 3] = [Self::Train, Self::Valid, Self::Test];

    /// The name of its folder.
    pub fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Valid => "valid",
            Self::Test => "test",
        }
    }

    /// The full name of one of its cases, such as `train/000`.
    pub fn case(self, name: &str) -> String {
        format!("{}/{name}", self.name())
    }
}

/// The trajectory files of a data set, by split.
#[derive(Clone, Debug, PartialEq)]
pub struct DataSet {
    /// The files of each split, sorted by name.
    pub splits: Vec<(Split, Vec<PathBuf>)>,
}

impl DataSet {
    /// The trajectories under `path`: the folders `train`, `valid` and `test` in it. A folder
    /// without them, and a single file, is a training set.
    ///
    /// # Errors
    /// If the folder cannot be read or holds no trajectory.
    pub fn open(path: &Path) -> Result<Self, DatasetError> {
        if path.is_file() {
            return Ok(Self { splits: vec![(Split::Train, vec![path.to_owned()])] });
        }
        let mut splits = Vec::new();
        for split in Split::ALL {
            let folder = path.join(split.name());
            if folder.is_dir() {
                splits.push((split, trajectories_in(&folder)?));
            }
        }
        if splits.is_empty() {
            splits.push((Split::Train, trajectories_in(path)?));
        }
        splits.retain(|(_, files)| !files.is_empty());
        if splits.is_empty() {
            return Err(DatasetError::Empty { path: path.to_owned() });
        }
        Ok(Self { splits })
    }

    /// The files of one split.
    pub fn files(&self, split: Split) -> &[PathBuf] {
        self.splits.iter().find(|(other, _)| *other == split).map_or(&[], |(_, files)| files)
    }
}

/// The `.h5` files of a folder by name.
fn trajectories_in(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let unreadable = |source| DatasetError::Read { path: folder.to_owned(), source };
    let mut files = std::fs::read_dir(folder)
        .map_err(unreadable)?
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<Result<Vec<_>, _>>()
        .map_err(unreadable)?;
    files.retain(|file| file.extension().is_some_and(|ending| ending == "h5"));
    files.sort();
    Ok(files)
}

/// Opens the trajectory of a finished run.
///
/// # Errors
/// If it cannot be read or its run is not finished.
pub fn open_finished(path: &Path) -> Result<Trajectory, DatasetError> {
    let trajectory = Trajectory::open(path)?;
    if trajectory.status() != "finished" {
        let (path, status) = (path.to_owned(), trajectory.status().to_owned());
        return Err(DatasetError::Unfinished { path, status });
    }
    Ok(trajectory)
}
