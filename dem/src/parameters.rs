//! Parameters of an RVE: its grains, homogenisation and preparation.

use serde::{Deserialize, Serialize};

use crate::grains::Grains;

/// A representative volume element (RVE): its grains, its size, its limits and its preparation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RveParameters {
    /// Grains and contact law.
    pub grains: Grains,
    /// Discs in one RVE.
    pub discs: usize,
    /// Trailing part of the substeps of one macro step over which stress is averaged.
    pub stress_window: f64,
    /// Adds the kinetic (Reynolds) part to the stress.
    pub kinetic_stress: bool,
    /// Below this solid fraction an RVE is stress-free: only its cell moves, and forces are
    /// computed again once it is denser than this.
    pub free_solid_fraction: f64,
    /// Below this perpendicular width of the cell, in mean diameters, a loaded cell is not
    /// thinned further: only the volumetric part and the spin of the velocity gradient act on it.
    pub thin_width: f64,
    /// Above this solid fraction a cell is not compressed further: it keeps the pressure it has. Grains overlap
    /// by more than a tenth of their radii there; only points alone in a splash come so far. The default is no limit.
    pub max_solid_fraction: f64,
    /// How the initial packing is made, with the grains' friction of preparation.
    pub preparation: Preparation,
}

/// How a packing is made: loose cloud, isotropic servo, then a ladder of loads.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Preparation {
    /// Isotropic pressure the servo consolidates to (Pa).
    pub pressure: f64,
    /// Solid fraction of the initial cloud of non-touching discs.
    pub cloud_solid_fraction: f64,
    /// Cundall local damping while preparing.
    pub local_damping: f64,
    /// Vertical strain rate of the compression that makes the ladder of stress states (1/s).
    pub ladder_rate: f64,
    /// Lateral over vertical strain in that compression. At 1 lateral stresses are near the vertical ones, as in a
    /// column of grains that settled smoothly; at 0 (oedometric) they are lower.
    pub lateral_strain: f64,
    /// Compresses with the friction of flow instead of that of preparation. Without lateral strain, lateral stresses
    /// are then about half the vertical ones.
    pub rough_ladder: bool,
}

impl Default for RveParameters {
    fn default() -> Self {
        Self {
            grains: Grains::default(),
            discs: 400,
            stress_window: 0.5,
            kinetic_stress: true,
            free_solid_fraction: 0.70,
            thin_width: 3.0,
            max_solid_fraction: 100.0,
            preparation: Preparation::default(),
        }
    }
}

impl Default for Preparation {
    fn default() -> Self {
        Self {
            pressure: 2.0e3,
            cloud_solid_fraction: 0.3,
            local_damping: 0.2,
            ladder_rate: 0.02,
            lateral_strain: 1.0,
            rough_ladder: false,
        }
    }
}
