//! A scene of a data set.

use std::path::{Path, PathBuf};

use super::split::Split;
use crate::scene::{Material, Scene};

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
    /// Its class, if it was drawn at random; else empty.
    pub class: String,
    /// Name of the first case with the same scene but for its seed; `None` for that case itself.
    pub same_as: Option<String>,
    /// Invalid scenes that were drawn before it.
    pub refused: u32,
}

impl Case {
    /// A case that was not drawn at random.
    pub fn new(split: Split, name: String, scene: Scene, values: String) -> Self {
        Self { split, name, scene, values, class: String::new(), same_as: None, refused: 0 }
    }

    /// Its trajectory in the data set `folder`.
    pub fn file(&self, folder: &Path) -> PathBuf {
        folder.join(self.split.name()).join(format!("{}.h5", self.name))
    }

    /// Its name with the split, such as `train/000`.
    pub fn full_name(&self) -> String {
        self.split.case(&self.name)
    }

    /// Discs of all its points, or of the whole scene; 0 for a continuum law.
    pub fn discs(&self) -> usize {
        let points = self.scene.point_count();
        match &self.scene.material {
            Material::Rve(rve) => points * rve.parameters.discs,
            Material::Discs(discs) => {
                discs.count_in(points as f64 * self.scene.point_area()).round() as usize
            }
            _ => 0,
        }
    }

    /// Points times steps, a measure of its cost.
    pub fn work(&self) -> u64 {
        self.scene.point_count() as u64 * self.scene.steps() as u64
    }
}
