//! The cost of a model before its first prediction.

use std::path::Path;

use serde::Deserialize;

/// Costs of a model, from the file `NAME.cost.toml` beside its weights.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelCost {
    /// Time to compute its training data, s.
    pub data_seconds: f64,
    /// Time to train it, s.
    pub training_seconds: f64,
    /// Device of both.
    pub device: String,
}

impl ModelCost {
    /// Reads the file beside a file of weights.
    ///
    /// # Errors
    /// A sentence that says why not, if the file is missing or invalid.
    pub fn beside(weights: &Path) -> Result<Self, String> {
        let path = weights.with_extension("cost.toml");
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let text = std::fs::read_to_string(&path)
            .map_err(|_| format!("there is no file `{name}` beside the weights."))?;
        toml::from_str(&text).map_err(|error| format!("`{name}`: {}.", error.message()))
    }

    /// Time to compute the data and to train, s.
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
        assert!(ModelCost::beside(&weights).unwrap_err().contains("tiny.cost.toml"));
        let text = "data_seconds = 10.0\ntraining_seconds = 300.0\ndevice = \"cpu\"\n";
        std::fs::write(folder.path().join("tiny.cost.toml"), text).unwrap();
        assert_eq!(ModelCost::beside(&weights).unwrap().total(), 310.0);
    }
}
