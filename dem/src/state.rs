//! What a macro step tells of an RVE.

use nalgebra::Matrix2;
use serde::{Deserialize, Serialize};

/// Homogenised state at the end of a macro step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RveState {
    /// Cauchy stress (Pa), compression positive, averaged over the trailing substeps.
    pub stress: Matrix2<f64>,
    /// Cell area (m²).
    pub area: f64,
    /// Area of the discs over the area of the cell.
    pub solid_fraction: f64,
    /// Contacts per disc `Z = 2 N_c / N` in the last substep.
    pub coordination: f64,
    /// Largest overlap over the smaller radius in any substep.
    pub relative_overlap: f64,
    /// Smallest perpendicular width of the cell (m); infinite while stress-free.
    pub min_width: f64,
    /// Number of neighbour searches.
    pub searches: u32,
    /// Whether the RVE is too loose to carry stress.
    pub free: bool,
    /// Whether the cell was too thin to be sheared.
    pub thin: bool,
    /// Whether it was too dense to be compressed.
    pub dense: bool,
}
