//! Trainings that start from a trained model.

use std::path::PathBuf;

use super::config::TrainConfig;
use super::error::TrainError;
use crate::diagnostics::TrainingRange;
use crate::features::Normalisation;
use crate::network::Initialisation;
use crate::network::burn_backend::device;
use crate::simulator::Simulator;

/// The model that a training starts from. The network keeps its normalisation, whatever the new
/// data are; frames further apart or closer together [stretch](Normalisation::stretched) it.
pub struct Pretrained {
    path: PathBuf,
    /// Hash of the file.
    pub hash: [u8; 32],
    /// The model.
    pub simulator: Simulator,
}

impl Pretrained {
    /// Loads the model of `start`, if that is a file, and adds the residual layers that it lacks.
    ///
    /// # Errors
    /// If the file cannot be read or is damaged.
    pub fn load(config: &TrainConfig) -> Result<Option<Self>, TrainError> {
        let Initialisation::Weights(path) = &config.start else { return Ok(None) };
        let bytes = std::fs::read(path)
            .map_err(|source| TrainError::ReadWeights { path: path.clone(), source })?;
        let mut simulator = Simulator::load(path)?;
        let network = config.model();
        simulator.model = simulator.model.grown(&network, config.seed, &device());
        simulator.config = network;
        let hash = *blake3::hash(&bytes).as_bytes();
        Ok(Some(Self { hash, simulator, path: path.clone() }))
    }

    /// Stretches the normalisation of the model to data with `interval` seconds between frames. Returns the model's
    /// own interval if that is another.
    ///
    /// # Errors
    /// If the model predicts accelerations relative to another fall.
    pub fn adapt(
        &mut self,
        config: &TrainConfig,
        interval: f64,
    ) -> Result<Option<f64>, TrainError> {
        let Simulator { training, normalisation, config: network, .. } = &mut self.simulator;
        if training.without_gravity != config.data.subtract_gravity {
            let (path, trained) = (self.path.clone(), training.without_gravity);
            return Err(TrainError::OtherGravity { path, trained });
        }
        if training.is_interval(interval) {
            return Ok(None);
        }
        let own = std::mem::replace(&mut training.frame_interval, interval);
        *normalisation = normalisation.stretched(&network.node_features, interval / own);
        Ok(Some(own))
    }
}

/// What a model takes over from the one it started from.
pub struct Lineage {
    /// Normalisation of inputs and targets.
    pub normalisation: Normalisation,
    /// Range of all data that it has learnt from; none if that is not known.
    pub range: Option<TrainingRange>,
    /// Training steps made before.
    pub steps: u64,
}

impl Lineage {
    /// Of a model with this normalisation and range of its data, or of the pretrained one.
    pub fn new(
        pretrained: Option<&Pretrained>,
        normalisation: Normalisation,
        range: Option<TrainingRange>,
    ) -> Self {
        let Some(Pretrained { simulator, .. }) = pretrained else {
            return Self { normalisation, range, steps: 0 };
        };
        let both = simulator.training.range.zip(range);
        Self {
            normalisation: simulator.normalisation.clone(),
            range: both.map(|(old, new)| old.and(new)),
            steps: simulator.training.steps,
        }
    }
}
