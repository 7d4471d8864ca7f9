//! Failures of the solver.

use crate::{Mat2, MaterialError, Vec2};

/// Why a solver could not be made or a step not be done. After a failed step the points are left
/// as they were when the fault was found.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The domain is impossible.
    #[error("domain: {0}")]
    Domain(String),
    /// The numerical scheme is impossible.
    #[error("numerics: {0}")]
    Numerics(String),
    /// An obstacle is impossible.
    #[error("obstacle {obstacle}: {reason}")]
    Obstacle {
        /// Its index.
        obstacle: usize,
        /// Why.
        reason: String,
    },
    /// Gravity (m/s²) is not finite.
    #[error("gravity ({}, {}) is not finite", .0.x, .0.y)]
    Gravity(Vec2),
    /// The step (s) is not positive.
    #[error("the step dt = {0} s is not a positive number")]
    Step(f64),
    /// Arrays of [`Points`](crate::Points) differ in length.
    #[error("points: array `{field}` has {found} entries, `position` has {expected}")]
    Length {
        /// Name of the array.
        field: &'static str,
        /// Number of points.
        expected: usize,
        /// Its length.
        found: usize,
    },
    /// A point has no mass.
    #[error("point {point}: mass {mass} kg/m is not a positive number")]
    Mass {
        /// Its index.
        point: usize,
        /// Its mass (kg/m).
        mass: f64,
    },
    /// A position or velocity is not finite.
    #[error("point {point}: position ({}, {}) or velocity ({}, {}) is not finite; is the step too large?", .position.x, .position.y, .velocity.x, .velocity.y)]
    NotFinite {
        /// Index of the point.
        point: usize,
        /// Its position (m).
        position: Vec2,
        /// Its velocity (m/s).
        velocity: Vec2,
    },
    /// A point is outside of the domain.
    #[error("point {point}: position ({}, {}) is outside of the domain, whose size is ({}, {})", .position.x, .position.y, .size.x, .size.y)]
    OutsideDomain {
        /// Index of the point.
        point: usize,
        /// Its position (m).
        position: Vec2,
        /// Size of the domain (m).
        size: Vec2,
    },
    /// A point is deep in an obstacle.
    #[error("point {point}: position ({}, {}) is more than a cell deep in obstacle {obstacle}", .position.x, .position.y)]
    InsideObstacle {
        /// Index of the point.
        point: usize,
        /// Its position (m).
        position: Vec2,
        /// Index of the obstacle.
        obstacle: usize,
    },
    /// The material's answer is impossible.
    #[error("point {point}: the material returned stress {stress:?} and volume {volume}")]
    Response {
        /// Index of the point.
        point: usize,
        /// Its stress (Pa).
        stress: Mat2,
        /// Its volume (m²).
        volume: f64,
    },
    /// The material failed.
    #[error(transparent)]
    Material(#[from] MaterialError),
}
