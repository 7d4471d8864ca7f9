//! Everything that changes during a run.

use std::collections::BTreeMap;

use mpm::{Ledger, Material, Points};
use serde::{Deserialize, Serialize};

use super::rve_material::RveMaterial;

/// Everything that changes during a run; a checkpoint holds this and nothing else.
#[derive(Clone, Serialize, Deserialize)]
pub struct State {
    /// Completed macro steps.
    pub step: usize,
    /// The material points.
    pub points: Points,
    /// Impulses and work of walls, obstacles and plate so far.
    pub ledger: Ledger,
    /// The material with its internal variables at every point.
    pub material: SceneMaterial,
    /// Wall time per phase (s), summed over all sessions of the run.
    pub wall_time: BTreeMap<String, f64>,
}

/// The material of a scene with its state.
#[derive(Clone, Serialize, Deserialize)]
pub enum SceneMaterial {
    /// A packing of discs in every point.
    Rve(Box<RveMaterial>),
    /// Drucker-Prager plasticity with rate-dependent friction.
    MuI(mpm::DruckerPrager),
    /// Linear elasticity.
    Elastic(mpm::Elastic),
}

impl SceneMaterial {
    pub(crate) fn as_dyn(&self) -> &dyn Material {
        match self {
            Self::Rve(material) => material.as_ref(),
            Self::MuI(material) => material,
            Self::Elastic(material) => material,
        }
    }

    pub(super) fn as_dyn_mut(&mut self) -> &mut dyn Material {
        match self {
            Self::Rve(material) => material.as_mut(),
            Self::MuI(material) => material,
            Self::Elastic(material) => material,
        }
    }
}
