//! The material of a scene on a GPU.

use std::sync::Arc;

use dem::cuda::Room;
use gpu::Device;
use gpu::ranks::Ranks;
use mpm::cuda::{CudaDruckerPrager, CudaElastic, CudaMaterial};

use super::rve_material::CudaRveMaterial;
use crate::simulation::error::SimulationError;
use crate::simulation::scene_material::SceneMaterial;

/// The twin of [`SceneMaterial`].
pub(super) enum DeviceMaterial {
    Rve(Box<CudaRveMaterial>),
    MuI(CudaDruckerPrager),
    Elastic(CudaElastic),
}

impl DeviceMaterial {
    /// Copies the material; as one of several ranks, with its share of the packings.
    pub fn new(
        device: &Arc<Device>,
        material: &SceneMaterial,
        room: Room,
        ranks: Option<&Arc<Ranks>>,
    ) -> Result<Self, SimulationError> {
        Ok(match material {
            SceneMaterial::Rve(rve) => {
                Self::Rve(Box::new(CudaRveMaterial::new(device, rve, room, ranks)?))
            }
            SceneMaterial::MuI(law) => Self::MuI(CudaDruckerPrager::new(device, law)?),
            SceneMaterial::Elastic(law) => Self::Elastic(CudaElastic::new(device, law)?),
        })
    }

    pub fn as_dyn(&self) -> &dyn CudaMaterial {
        match self {
            Self::Rve(material) => material.as_ref(),
            Self::MuI(material) => material,
            Self::Elastic(material) => material,
        }
    }

    pub fn as_dyn_mut(&mut self) -> &mut dyn CudaMaterial {
        match self {
            Self::Rve(material) => material.as_mut(),
            Self::MuI(material) => material,
            Self::Elastic(material) => material,
        }
    }
}
