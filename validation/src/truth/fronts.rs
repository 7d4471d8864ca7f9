//! The fronts of a pile.

use dempm::fronts::mass_front;

/// Fronts along x, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fronts {
    /// Edge of the point behind which 99 % of the mass is.
    pub mass: f64,
    /// The front of what hangs together, where the trajectory has it.
    pub connected: Option<f64>,
}

/// The fronts of points of side `spacing` (m).
pub(super) fn fronts(position: &[[f64; 2]], mass: &[f64], spacing: f64) -> Fronts {
    Fronts { mass: mass_front(position, mass) + 0.5 * spacing, connected: None }
}
