//! `metadata.json` as geoelements/gns and LagrangeBench read it.

use std::path::Path;

use files::WriteError;
use serde::Serialize;

use crate::dataset::{Metadata, write_metadata};

/// Columns of the node features of geoelements/gns in two dimensions: velocities of 5 frames, distances
/// to 4 bounds and 16 of the particle type (`gns/learned_simulator.py`).
const NODE_FEATURES: usize = 5 * 2 + 4 + 16;
/// Columns of its edge features: relative position and distance.
const EDGE_FEATURES: usize = 3;

/// The metadata of geoelements/gns, which looks for settings of rollouts under `rollout` first.
#[derive(Serialize)]
pub(super) struct GnsMetadata {
    #[serde(flatten)]
    common: Common,
    rollout: Common,
}

#[derive(Clone, Serialize)]
struct Common {
    #[serde(flatten)]
    metadata: Metadata,
    #[serde(flatten)]
    widths: Option<Widths>,
}

/// Widths of the network's input when every particle has a material property.
#[derive(Clone, Serialize)]
struct Widths {
    material_feature_len: usize,
    nnode_in: usize,
    nedge_in: usize,
}

impl GnsMetadata {
    /// For data with or without a material property. Rollouts have the length of each trajectory.
    pub fn new(metadata: &Metadata, material_property: bool) -> Self {
        let widths = material_property.then_some(Widths {
            material_feature_len: 1,
            nnode_in: NODE_FEATURES + 1,
            nedge_in: EDGE_FEATURES,
        });
        let common = Common { metadata: metadata.clone(), widths };
        let mut rollout = common.clone();
        rollout.metadata.sequence_length = None;
        Self { common, rollout }
    }

    /// Writes `metadata.json` into a folder.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        write_metadata(self, folder)
    }
}

/// The metadata of LagrangeBench. With wall particles, `bounds` are half a spacing beyond them, since
/// its search for neighbours needs all particles inside (`jax_md/partition.py`).
pub(super) fn lagrangebench_metadata(mut metadata: Metadata, walls: bool) -> Metadata {
    if walls {
        let margin = 0.5 * metadata.dx;
        metadata.bounds = metadata.bounds.map(|[low, high]| [low - margin, high + margin]);
    }
    metadata
}
