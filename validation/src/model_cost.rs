//! What a model has cost before its first prediction.

use std::path::Path;

use serde::Deserialize;

use crate::block::Missing;

/// Costs of a model, from the file `NAME.cost.toml` beside its weights.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelCost {
    /// Time to compute the data that it learnt from, s.
    pub data_seconds: f64,
    /// Time to train it, s.
    pub training_seconds: f64,
    /// What both ran on.
    pub device: String,
}

impl ModelCost {
    /// Reads the file beside a file of weights.
    ///
    /// # Errors
    /// What is missing, if it is not there or wrong.
    pub fn beside(weights: &Path) -> Result<Self, Missing> {
        let path = weights.with_extension("cost.toml");
        let missing = |why: String| Missing {
            what: "Costs of a model".to_owned(),
            why,
            remedy: "It has the keys `data_seconds`, `training_seconds` and `device`.".to_owned(),
        };
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let text = std::fs::read_to_string(&path)
            .map_err(|_| missing(format!("there is no file `{name}` beside the weights.")))?;
        toml::from_str(&text).map_err(|error| missing(format!("`{name}`: {}.", error.message())))
    }

    /// Both together, s.
    pub fn total(&self) -> f64 {
        self.data_seconds + self.training_seconds
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costs_are_read_or_missed() {
        let folder = tempfile::tempdir().unwrap();
        let weights = folder.path().join("tiny.safetensors");
        assert!(ModelCost::beside(&weights).unwrap_err().why.contains("tiny.cost.toml"));
        let text = "data_seconds = 10.0\ntraining_seconds = 300.0\ndevice = \"cpu\"\n";
        std::fs::write(folder.path().join("tiny.cost.toml"), text).unwrap();
        assert_eq!(ModelCost::beside(&weights).unwrap().total(), 310.0);
    }
}
