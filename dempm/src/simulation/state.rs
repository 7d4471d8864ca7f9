//! Everything that changes during a run.

use std::collections::BTreeMap;

use mpm::Points;
use serde::{Deserialize, Serialize};

use super::discs::DiscState;
use super::mpm_model::MpmState;

/// Everything that changes during a run; a checkpoint holds this and nothing else.
#[derive(Clone, Serialize, Deserialize)]
pub struct State {
    /// Completed macro steps.
    pub step: usize,
    /// The material points.
    pub points: Points,
    /// The state of the model that moves them.
    pub model: ModelState,
    /// Wall time per phase (s), summed over all sessions of the run.
    pub wall_time: BTreeMap<String, f64>,
}

/// The state of a model.
#[derive(Clone, Serialize, Deserialize)]
pub enum ModelState {
    /// The material point method.
    Mpm(MpmState),
    /// Every grain as a disc.
    Discs(Box<DiscState>),
}
