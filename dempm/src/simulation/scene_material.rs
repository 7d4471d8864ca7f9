//! The material of a scene under the material point method.

use mpm::Material;
use serde::{Deserialize, Serialize};

use super::rve_material::RveMaterial;

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
