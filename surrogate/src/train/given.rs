//! Trainings that start from the weights of another.

use std::path::PathBuf;

use miette::{IntoDiagnostic, WrapErr, bail};

use super::config::TrainConfig;
use crate::features::Normalisation;
use crate::model::Start;
use crate::range::Range;
use crate::simulator::Simulator;

/// The model that a training starts from. Its network goes on to see what it has always seen: it keeps
/// its normalisation, whatever the new data are.
pub struct Given {
    path: PathBuf,
    /// A hash of the file.
    pub hash: [u8; 32],
    pub simulator: Simulator,
}

impl Given {
    /// Loads it, if a training starts from one.
    ///
    /// # Errors
    /// If the file cannot be read or is damaged.
    pub fn load(config: &TrainConfig) -> miette::Result<Option<Self>> {
        let Start::Weights(path) = &config.start else { return Ok(None) };
        let bytes = std::fs::read(path)
            .into_diagnostic()
            .wrap_err_with(|| format!("{}: cannot read it", path.display()))?;
        Ok(Some(Self {
            hash: *blake3::hash(&bytes).as_bytes(),
            simulator: Simulator::load(path)?,
            path: path.clone(),
        }))
    }

    /// Refuses trainings of what the model does not predict; `interval` is the time between frames (s).
    ///
    /// # Errors
    /// Frames another time apart, or accelerations relative to another fall.
    pub fn check(&self, config: &TrainConfig, interval: f64) -> miette::Result<()> {
        let path = self.path.display();
        let was = &self.simulator.training;
        if !was.is_interval(interval) {
            bail!(
                help = "`data.stride` takes every n-th frame of the data",
                "`start` = {path}: the network was trained on frames {} s apart, these are {interval} s \
                 apart",
                was.frame_interval
            );
        }
        if was.without_gravity != config.data.subtract_gravity {
            bail!(
                "`start` = {path}: the network was trained with `data.subtract_gravity` = {}",
                was.without_gravity
            );
        }
        Ok(())
    }

    /// Its normalisation.
    pub fn normalisation(&self) -> Normalisation {
        self.simulator.normalisation.clone()
    }

    /// What it and new data hold; not known if it does not say.
    pub fn range(&self, new: Option<Range>) -> Option<Range> {
        Some(self.simulator.training.range?.and(new?))
    }
}
