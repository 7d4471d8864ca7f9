//! What can go wrong in the solver.

use crate::{Mat2, MaterialError, Vec2};

/// Why a solver could not be made or a step not be done. After a failed step the points are left
/// as they were when the fault was found.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("domain: {0}")]
    Domain(String),
    #[error("numerics: {0}")]
    Numerics(String),
    #[error("obstacle {obstacle}: {reason}")]
    Obstacle { obstacle: usize, reason: String },
    #[error("gravity ({}, {}) is not finite", .0.x, .0.y)]
    Gravity(Vec2),
    #[error("the step dt = {0} s is not a positive number")]
    Step(f64),
    #[error("points: array `{field}` has {found} entries, `position` has {expected}")]
    Length { field: &'static str, expected: usize, found: usize },
    #[error("point {point}: mass {mass} kg/m is not a positive number")]
    Mass { point: usize, mass: f64 },
    #[error("point {point}: position ({}, {}) or velocity ({}, {}) is not finite; is the step too large?", .position.x, .position.y, .velocity.x, .velocity.y)]
    NotFinite { point: usize, position: Vec2, velocity: Vec2 },
    #[error("point {point}: position ({}, {}) is outside of the domain, whose size is ({}, {})", .position.x, .position.y, .size.x, .size.y)]
    OutsideDomain { point: usize, position: Vec2, size: Vec2 },
    #[error("point {point}: position ({}, {}) is more than a cell deep in obstacle {obstacle}", .position.x, .position.y)]
    InsideObstacle { point: usize, position: Vec2, obstacle: usize },
    #[error("point {point}: the material returned stress {stress:?} and volume {volume}")]
    Response { point: usize, stress: Mat2, volume: f64 },
    #[error(transparent)]
    Material(#[from] MaterialError),
}
