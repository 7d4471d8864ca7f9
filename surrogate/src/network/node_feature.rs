//! Optional node features of a network.
//!
//! A rollout knows positions only, so a feature of a later frame must follow from positions
//! (overburden, acceleration) or stay at its initial value: otherwise the network would have to
//! predict it too.

use serde::{Deserialize, Serialize};

use crate::features::{MATERIAL_COLUMNS, SURFACE_COLUMNS};

/// An optional feature of every node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NodeFeature {
    /// Points above this one in a strip one connection radius wide: the load it would carry if
    /// stress were hydrostatic. Changes from frame to frame.
    Overburden,
    /// Second difference of the positions in the frame and the two before, m/frame². Velocities
    /// contain it too, but as a difference of a hundredth of their size.
    Acceleration,
    /// Pressure and shear stress (Pa) in the first frame of the trajectory: invariants, the same in a
    /// mirror.
    InitialStress,
    /// Solid fraction in the first frame of the trajectory.
    InitialSolidFraction,
    /// The nearest surface of a fixed box and that of a moving one
    /// ([`surfaces`](fn@crate::features::surfaces)). Changes from frame to frame.
    Surfaces,
    /// Friction of the grains, size of the grains, friction and kind of the floor
    /// ([`material`](fn@crate::features::material)): the same for all points.
    Material,
}

impl NodeFeature {
    /// Columns that it adds to a node.
    pub fn columns(self, dimensions: usize) -> usize {
        match self {
            Self::Overburden | Self::InitialSolidFraction => 1,
            Self::InitialStress => 2,
            Self::Acceleration => dimensions,
            Self::Surfaces => SURFACE_COLUMNS,
            Self::Material => MATERIAL_COLUMNS,
        }
    }

    /// Whether it is static: constant for a point.
    pub fn is_static(self) -> bool {
        !matches!(self, Self::Overburden | Self::Acceleration | Self::Surfaces)
    }

    /// Earlier frames that it depends on.
    pub fn frames_before(self) -> usize {
        if self == Self::Acceleration { 2 } else { 0 }
    }
}

/// Columns of all features, and of the static ones.
pub fn feature_columns(features: &[NodeFeature], dimensions: usize) -> [usize; 2] {
    let sum = |all: bool| {
        let counted = features.iter().filter(|f| all || f.is_static());
        counted.map(|f| f.columns(dimensions)).sum::<usize>()
    };
    [sum(true), sum(false)]
}
