//! A scene of a data set.

use std::path::{Path, PathBuf};

use super::split::Split;
use crate::scene::Scene;

/// A scene of a data set.
#[derive(Clone, Debug)]
pub struct Case {
    /// The split that it belongs to.
    pub split: Split,
    /// Name of its file without suffix.
    pub name: String,
    /// The scene.
    pub scene: Scene,
    /// The keys and values that distinguish it from other cases of a list; empty in the paper's set.
    pub values: String,
}

impl Case {
    /// Its trajectory in the data set `folder`.
    pub fn file(&self, folder: &Path) -> PathBuf {
        folder.join(self.split.name()).join(format!("{}.h5", self.name))
    }

    /// Its name with the split, such as `train/000`.
    pub fn full_name(&self) -> String {
        self.split.case(&self.name)
    }

    /// Points times steps, a measure of its cost.
    pub fn work(&self) -> u64 {
        self.scene.point_count() as u64 * self.scene.steps() as u64
    }
}
