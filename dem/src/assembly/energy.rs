//! The energy budget of an assembly.

use std::ops::AddAssign;

use serde::{Deserialize, Serialize};

/// Energy lost or supplied since the start (J).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Losses {
    /// Dissipated by the normal dashpots of contacts.
    pub dashpots: f64,
    /// Dissipated by sliding and by rolling.
    pub friction: f64,
    /// Dissipated by local damping and drag.
    pub damping: f64,
    /// Supplied by moving boxes.
    pub boxes: f64,
}

impl AddAssign for Losses {
    fn add_assign(&mut self, other: Self) {
        self.dashpots += other.dashpots;
        self.friction += other.friction;
        self.damping += other.damping;
        self.boxes += other.boxes;
    }
}

/// The energy of an assembly (J).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Of translation and rotation.
    pub kinetic: f64,
    /// $-\sum m \mathbf g \cdot \mathbf x$, zero at the origin.
    pub potential: f64,
    /// Of all contacts: $k_n \delta^2 / 2 + f_t^2 / (2 k_t) + s^2 / (2 k_r)$ each, with the rolling spring $s$.
    pub elastic: f64,
    /// Losses since the start.
    pub losses: Losses,
}

impl Energy {
    /// What stays constant: all forms of energy with what is lost, less what was supplied (J).
    pub fn total(&self) -> f64 {
        let Losses { dashpots, friction, damping, boxes } = self.losses;
        self.kinetic + self.potential + self.elastic + dashpots + friction + damping - boxes
    }

    /// All that was dissipated (J).
    pub fn dissipated(&self) -> f64 {
        self.losses.dashpots + self.losses.friction + self.losses.damping
    }
}
