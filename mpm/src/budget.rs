//! Mass, momentum and energy.

use serde::{Deserialize, Serialize};

use crate::{Points, Vec2};

/// Impulses and work of contacts since the start of the run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Ledger {
    /// Momentum that the walls gave to the material (kg/s, i.e. N s per m of thickness).
    pub wall_impulse: Vec2,
    /// Momentum that each obstacle gave to the material (kg/s).
    pub obstacle_impulse: Vec<Vec2>,
    /// Work of moving obstacles on the material (J/m).
    pub plate_work: f64,
    /// How often a point was moved back onto a wall or face it had crossed.
    pub projected: u64,
}

impl Ledger {
    pub(crate) fn new(obstacles: usize) -> Self {
        Self { obstacle_impulse: vec![Vec2::zeros(); obstacles], ..Self::default() }
    }

    pub(crate) fn book_obstacle(&mut self, obstacle: usize, impulse: Vec2, velocity: Vec2) {
        self.obstacle_impulse[obstacle] += impulse;
        self.plate_work += impulse.dot(&velocity);
    }
}

/// Sums over all points, and impulses and work of contacts.
///
/// Momentum balances to round-off: `momentum(t) - momentum(0)` is `mass * gravity * t` plus all
/// impulses.
#[derive(Clone, Debug, PartialEq)]
pub struct Budget {
    /// Mass (kg/m).
    pub mass: f64,
    /// Momentum (kg/s).
    pub momentum: Vec2,
    /// Kinetic energy `sum m v² / 2` (J/m).
    pub kinetic_energy: f64,
    /// Potential energy `- sum m g . x` (J/m).
    pub potential_energy: f64,
    /// Impulses and work of contacts since the start.
    pub contact: Ledger,
}

pub(crate) fn budget(points: &Points, gravity: Vec2, contact: &Ledger) -> Budget {
    let mut sum = Budget {
        mass: 0.0,
        momentum: Vec2::zeros(),
        kinetic_energy: 0.0,
        potential_energy: 0.0,
        contact: contact.clone(),
    };
    for ((m, v), x) in points.mass.iter().zip(&points.velocity).zip(&points.position) {
        sum.mass += m;
        sum.momentum += v * *m;
        sum.kinetic_energy += 0.5 * m * v.norm_squared();
        sum.potential_energy -= m * gravity.dot(x);
    }
    sum
}
