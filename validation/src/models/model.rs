//! A trained model and its prediction settings.

use std::path::{Path, PathBuf};

use surrogate::network::Precision;
use surrogate::simulator::{Simulator, Training};

use crate::folder::{files_in, stem};

/// A trained model, and how it predicts.
#[derive(Clone, Debug)]
pub struct Model {
    /// Name of the folder for `NAME/best.safetensors`, else of the file, followed by the prediction
    /// settings that are not the defaults.
    pub name: String,
    /// File of the weights.
    pub path: PathBuf,
    /// Whether it learnt from discs; else from packings.
    pub of_discs: bool,
    /// Precision of matrix products.
    pub precision: Precision,
    /// Whether predictions are averaged with those of the mirrored window.
    pub mirror: bool,
    /// Number of frames to predict, at the model's interval; `None` for all.
    pub frames: Option<usize>,
}

impl Model {
    /// A file of weights with the default prediction settings. What cannot be read fails when it predicts.
    pub fn new(name: String, path: PathBuf) -> Self {
        let of_discs = Simulator::load(&path).is_ok_and(|network| is_of_discs(&network.training));
        Self { name, path, of_discs, precision: Precision::F32, mirror: false, frames: None }
    }

    /// The same model in bf16, which needs a GPU.
    #[must_use]
    pub fn in_bf16(&self) -> Self {
        let name = format!("{}, bf16", self.name);
        Self { name, precision: Precision::Bf16, ..self.clone() }
    }

    /// The same model with mirror images averaged, at twice the cost.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        Self { name: format!("{}, mirror", self.name), mirror: true, ..self.clone() }
    }

    /// A log of its training: in the training's folder, or beside the weights as `NAME.FILE`.
    pub fn log(&self, file: &str) -> PathBuf {
        if self.path.ends_with("best.safetensors") {
            self.path.with_file_name(file)
        } else {
            self.path.with_extension(file)
        }
    }
}

/// Whether a network learnt from discs; else from packings.
pub fn is_of_discs(training: &Training) -> bool {
    training.material.as_deref() == Some("discs")
}

/// Models in a folder, sorted by name: `NAME.safetensors` and `NAME/best.safetensors`.
pub fn models_in(folder: &Path) -> Vec<Model> {
    let mut models: Vec<Model> = files_in(folder, "safetensors")
        .into_iter()
        .map(|path| Model::new(stem(&path), path))
        .collect();
    let folders = std::fs::read_dir(folder).into_iter().flatten().flatten();
    for path in folders.map(|entry| entry.path().join("best.safetensors")) {
        if path.exists() {
            models.push(Model::new(path.parent().map(stem).unwrap_or_default(), path));
        }
    }
    models.sort_by(|a, b| a.name.cmp(&b.name));
    models
}
