//! Discs.

use serde::{Deserialize, Serialize};

use crate::real::Real;

/// One disc. Velocities are peculiar: what is left after the affine motion `L x` of the cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[repr(C, align(32))]
#[serde(bound = "")]
pub struct Disc<R: Real> {
    /// Reduced position: fractions of the cell vectors `a` and `b`.
    pub s: [R::Fraction; 2],
    /// Peculiar velocity (m/s).
    pub u: [R; 2],
    /// Angular velocity (1/s), counter-clockwise.
    pub w: R,
    /// Radius (m).
    pub r: R,
    /// Inverse mass (1/kg).
    pub inv_mass: R,
    /// Inverse moment of inertia `2 / (m r²)` (1/(kg m²)).
    pub inv_inertia: R,
}

/// A disc as plain numbers, for input and output.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlainDisc {
    /// Position in the cell (m).
    pub x: [f64; 2],
    /// Radius (m).
    pub r: f64,
}
