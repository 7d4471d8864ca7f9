//! Reading and validating training files.

use std::path::Path;
use std::sync::Arc;

use miette::NamedSource;

use super::config::TrainConfig;
use super::config_error::ConfigError;
use super::schedule::Schedule;
use crate::network::Initialisation;
use crate::network::burn_backend::{Cpu, device};
use crate::network::weights;

impl TrainConfig {
    /// Reads and validates a training file. The path of weights to start from is relative to its
    /// folder; without `network` and `model`, the network is theirs.
    ///
    /// # Errors
    /// If the file cannot be read or a value is wrong (the error names the key), or if the weights
    /// belong to another network.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| ConfigError::Read { path: path.to_owned(), source })?;
        let file = path.display().to_string();
        let mut config = Self::read(&text, &file)?;
        if let Initialisation::Weights(weights) = &config.start {
            let weights = path.parent().unwrap_or(Path::new("")).join(weights);
            config.take_network(&weights, &file)?;
            config.start = Initialisation::Weights(weights);
        }
        config.check(&file)?;
        Ok(config)
    }

    /// Parses and validates the text of a training file, except for weights to start from. `file`
    /// is its name in errors.
    ///
    /// # Errors
    /// If a value is wrong; the error names the key.
    pub fn parse(text: &str, file: &str) -> Result<Self, ConfigError> {
        let config = Self::read(text, file)?;
        config.check(file)?;
        Ok(config)
    }

    fn read(text: &str, file: &str) -> Result<Self, ConfigError> {
        toml::from_str(text).map_err(|error| ConfigError::Syntax {
            file: file.to_owned(),
            message: error.message().to_owned(),
            text: Arc::new(NamedSource::new(file, text.to_owned()).with_language("TOML")),
            place: error.span().map(Into::into),
        })
    }

    /// Adopts the network of a weights file, unless the training file specifies one.
    fn take_network(&mut self, weights: &Path, file: &str) -> Result<(), ConfigError> {
        let (_, mut found, ..) = weights::load::<Cpu>(weights, &device()).map_err(|source| {
            ConfigError::Start { file: file.to_owned(), source: source.into() }
        })?;
        if self.network.is_none() && self.model.is_none() {
            self.model = Some(found);
            return Ok(());
        }
        let network = self.network(file)?;
        // Layers that the weights lack begin as nothing.
        found.residual_layers = found.residual_layers.max(network.residual_layers);
        let differences = network.differences(&found);
        if differences.is_empty() {
            return Ok(());
        }
        let (file, weights) = (file.to_owned(), weights.to_owned());
        Err(ConfigError::OtherNetwork { file, weights, differences: differences.join(", ") })
    }

    fn check(&self, file: &str) -> Result<(), ConfigError> {
        let model = self.network(file)?;
        model.validate().map_err(|source| ConfigError::Model { file: file.to_owned(), source })?;
        let Schedule { rate, final_rate, decay_steps, .. } = self.schedule;
        let limits = [
            ("steps", self.steps as f64, 1.0, 1e12),
            ("batch", self.batch as f64, 1.0, 4096.0),
            ("ema", self.ema, 0.0, 0.999_999_9),
            ("loss_floor", self.loss_floor, 0.0, 1e3),
            ("log_every", self.log_every as f64, 1.0, 1e9),
            ("data.stride", self.data.stride as f64, 1.0, 1e4),
            ("data.before_start", self.data.before_start as f64, 0.0, (model.window() - 1) as f64),
            ("data.emphasis", self.data.emphasis as f64, 1.0, 100.0),
            ("data.noise", self.data.noise, 0.0, 1e3),
            ("data.memory", self.data.memory as f64, 0.0, 1e7),
            ("schedule.rate", rate, 1e-12, 1.0),
            ("schedule.final_rate", final_rate, 0.0, rate),
            ("schedule.decay_steps", decay_steps, 1.0, 1e12),
            ("pushforward.steps", self.pushforward.steps as f64, 0.0, 16.0),
            ("validation.every", self.validation.every as f64, 1.0, 1e12),
        ];
        for (key, value, low, high) in limits {
            if !(low..=high).contains(&value) {
                let (file, value) = (file.to_owned(), value.to_string());
                let range = format!("from {low} to {high}");
                return Err(ConfigError::Range { file, key, value, range });
            }
        }
        let given = model.window() - self.data.before_start;
        if (1..=given).contains(&self.validation.frames) {
            return Err(ConfigError::Range {
                file: file.to_owned(),
                key: "validation.frames",
                value: self.validation.frames.to_string(),
                range: format!(
                    "0 (all) or at least {}, since rollouts start from {given} frames",
                    given + 1
                ),
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::ModelConfig;

    fn message(text: &str) -> String {
        let error = TrainConfig::parse(text, "training.toml").unwrap_err();
        format!("{:?}", miette::Report::new(error))
    }

    #[test]
    fn an_empty_file_is_the_paper() {
        let config = TrainConfig::parse("", "training.toml").unwrap();
        assert_eq!(config, TrainConfig::default());
        assert_eq!(config.model(), ModelConfig::named("baseline").unwrap());
    }

    #[test]
    fn errors_name_file_and_key() {
        for (text, key) in [
            ("step = 5", "step"),
            ("steps = \"many\"", "steps"),
            ("batch = 0", "batch"),
            ("network = \"huge\"", "network"),
            ("network = \"msg0\"\n[model]\nwidth = 8", "network"),
            ("[model]\nwidth = 0", "width"),
            ("[model]\ndimensions = 3", "`dimensions`"),
            ("[data]\nnoise = -1.0", "data.noise"),
            ("[data]\nemphasis = 0", "data.emphasis"),
            ("[schedule]\nfinal_rate = 1.0", "schedule.final_rate"),
            ("[schedule]\nkind = \"linear\"", "linear"),
            ("[pushforward]\nsteps = 100", "pushforward.steps"),
            ("precision = \"f16\"", "f16"),
            ("start = \"identify\"", "safetensors"),
            ("[validation]\neach = 3", "each"),
            ("[model]\nframes = 65", "frames"),
        ] {
            let message = message(text);
            assert!(message.contains("training.toml"), "{message}");
            assert!(message.contains(key), "{message}");
        }
    }

    #[test]
    fn a_validation_predicts_a_frame_at_least() {
        let config = |frames: usize, more: &str| {
            format!("[validation]\nframes = {frames}\n[data]\n{more}\n[model]\nframes = 4")
        };
        for (frames, more) in [(0, ""), (5, ""), (2, "before_start = 3")] {
            TrainConfig::parse(&config(frames, more), "training.toml").unwrap();
        }
        for (frames, more, least) in [(1, "", 5), (4, "", 5), (1, "before_start = 3", 2)] {
            let error = TrainConfig::parse(&config(frames, more), "training.toml").unwrap_err();
            let message = error.to_string();
            assert!(message.contains(&format!("`validation.frames` is {frames}")), "{message}");
            assert!(message.contains(&format!("at least {least}")), "{message}");
        }
    }
}
