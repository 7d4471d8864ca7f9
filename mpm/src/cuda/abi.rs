//! Structs that Rust and the kernels share.

use gpu::{ConstPointer, Pointer, cuda_enum, cuda_struct, cuda_types};

use crate::friction::{Friction, Walls};
use crate::{Mat2, Vec2};

cuda_struct! {
    /// A vector in the plane; `Vec` in the kernels.
    #[derive(Default)]
    #[align(16)]
    pub struct Vector {
        /// To the right.
        pub x: f64,
        /// Up.
        pub y: f64,
    }

    /// A tensor in the plane, row by row.
    #[derive(Default)]
    #[align(16)]
    pub struct Matrix {
        /// First row.
        pub xx: f64,
        /// First row.
        pub xy: f64,
        /// Second row.
        pub yx: f64,
        /// Second row.
        pub yy: f64,
    }
}

cuda_types! {
    /// Basis functions of all nodes that one point sees; defined in `mpm.cuh`.
    pub struct Stencil;
}

/// Bytes of a [`Stencil`]: corner, three sets of weights along two axes, node.
pub(super) const fn stencil_bytes(width: usize) -> usize {
    (2 * 8 + 3 * 2 * width * 8 + 4_usize).next_multiple_of(16)
}

cuda_struct! {
    /// A rigid box ([`crate::Obstacle`]).
    #[derive(Default)]
    pub struct Obstacle {
        /// Lower left corner (m) until `start`.
        pub min: [f64; 2],
        /// Upper right corner (m) until `start`.
        pub max: [f64; 2],
        /// Coefficients of friction of the left, right, bottom and top face: 0 slips, infinity sticks.
        pub friction: [f64; 4],
        /// Velocity (m/s) from `start` on.
        pub velocity: [f64; 2],
        /// When the box begins to move (s).
        pub start: f64,
    }

    /// A box as it stands and moves in one step; sides on or behind a wall are at infinity.
    #[derive(Default)]
    pub struct Placed {
        /// Lower left corner (m).
        pub min: [f64; 2],
        /// Upper right corner (m).
        pub max: [f64; 2],
        /// As of [`Obstacle`].
        pub friction: [f64; 4],
        /// Mean velocity over the step (m/s).
        pub velocity: Vector,
    }

    /// How fast a node may approach what it meets (m/s), so that the nearest point that it sees comes to touch.
    #[derive(Default)]
    pub struct Approach {
        /// Left and right wall.
        pub x: f64,
        /// Bottom and top wall.
        pub y: f64,
        /// The box that it lies in.
        pub obstacle: f64,
    }

    /// Points sorted by cells: a list for each cell, in ascending order. Entries of `head` and `first`
    /// hold the step in which they were made (upper half) and a point; those of earlier steps mean an
    /// empty cell.
    pub struct Bins {
        /// Cell of each point.
        pub cell: Pointer<i32>,
        /// The point of each cell that was pushed last.
        pub head: Pointer<u64>,
        /// The point that was pushed before each point.
        pub next: Pointer<i32>,
        /// Lowest point of each cell.
        pub first: Pointer<u64>,
        /// The next higher point of the same cell.
        pub successor: Pointer<i32>,
    }

    /// Progress of the run. From the step after a failure on nothing moves.
    #[derive(Default)]
    pub struct Clock {
        /// Steps since the upload.
        pub step: u64,
        /// [`Phase`] of the failure (upper half) and point: the smallest is the failure that the CPU
        /// would have met first. [`NO_FAILURE`] while there is none.
        pub failure: u64,
        /// 1 while there is no failure, else 0.
        pub running: u64,
    }
}

/// [`Clock::failure`] while there is none.
pub(super) const NO_FAILURE: u64 = u64::MAX;

cuda_enum! {
    /// Part of a step: USF updates stresses before points move, the other schemes after.
    pub enum Phase: u32 {
        /// Stresses, under USF.
        STRESS_FIRST = 0,
        /// Motion of the points.
        MOTION = 1,
        /// Stresses, under MUSL and USL.
        STRESS_LAST = 2,
    }

    /// Why a point failed.
    pub enum Fault: i32 {
        /// Position or velocity is not finite.
        NOT_FINITE = 1,
        /// The point left the domain.
        OUTSIDE_DOMAIN = 2,
        /// The stress is not finite or the volume is not positive.
        BAD_RESPONSE = 3,
        /// A material failed.
        MATERIAL = 4,
        /// The point is deep in an obstacle, whose index is added to this number.
        INSIDE_OBSTACLE = 5,
    }
}

cuda_struct! {
    /// Argument of all kernels: numbers and arrays of the solver.
    pub struct Mpm {
        /// Side of a cell (m).
        pub cell: f64,
        /// Of the domain (m).
        pub width: f64,
        /// Of the domain (m).
        pub height: f64,
        /// The step (s).
        pub dt: f64,
        /// Gravity (m/s²).
        pub gravity_x: f64,
        /// Gravity (m/s²).
        pub gravity_y: f64,
        /// Nodes up to this mass (kg/m) are left at rest.
        pub cutoff: f64,
        /// Share of PIC in the new point velocity.
        pub pic_share: f64,
        /// Rate of the density correction (1/s).
        pub density_rate: f64,
        /// Width of shocks (m).
        pub shock_width: f64,
        /// Coefficients of friction of the left, right, bottom and top wall, as of [`Obstacle`].
        pub friction: [f64; 4],
        /// Steps before the upload.
        pub first_step: u64,
        /// Nodes in a row, ghosts included.
        pub columns: i32,
        /// Rows of nodes, ghosts included.
        pub rows: i32,
        /// Cells of the domain along x.
        pub cells_x: i32,
        /// Cells of the domain along y.
        pub cells_y: i32,
        /// Number of points.
        pub points: i32,
        /// Number of obstacles.
        pub obstacles: i32,
        /// 1 if points carry the affine velocity matrix, else 0.
        pub affine: i32,
        /// [`Phase`] of the update of stresses.
        pub stress_phase: u32,

        /// Progress of the run.
        pub clock: Pointer<Clock>,
        /// All obstacles.
        pub obstacle: ConstPointer<Obstacle>,
        /// All obstacles at the beginning of the step, then at its end.
        pub placed: Pointer<Placed>,

        /// Position of each point (m).
        pub position: Pointer<Vector>,
        /// Velocity of each point (m/s).
        pub velocity: Pointer<Vector>,
        /// Affine velocity matrix of each point (1/s).
        pub affine_velocity: Pointer<Matrix>,
        /// Mass of each point (kg/m).
        pub mass: ConstPointer<f64>,
        /// Volume of each point (m²).
        pub volume: Pointer<f64>,
        /// Velocity gradient of each point (1/s).
        pub velocity_gradient: Pointer<Matrix>,
        /// Cauchy stress of each point (Pa).
        pub stress: Pointer<Matrix>,
        /// Basis functions at each point.
        pub stencil: Pointer<Stencil>,
        /// [`Fault`] of each point, or 0.
        pub fault: Pointer<i32>,

        /// Mass of each node (kg/m).
        pub node_mass: Pointer<f64>,
        /// Area of each node (m²), where densities are corrected.
        pub node_area: ConstPointer<f64>,
        /// Momentum of each node (kg/s).
        pub node_momentum: Pointer<Vector>,
        /// Velocity of each node before the step (m/s).
        pub node_old_velocity: Pointer<Vector>,
        /// Velocity of each node (m/s).
        pub node_velocity: Pointer<Vector>,
        /// How fast each node may approach walls and boxes, where these wait for points.
        pub node_approach: Pointer<Approach>,

        /// Contacts of nodes since the last sum: impulses by the walls (x, y) and by each obstacle (x, y),
        /// work of the obstacles, number of projections; each an array over all nodes.
        pub node_ledger: Pointer<f64>,
        /// The same of points.
        pub point_ledger: Pointer<f64>,

        /// Points by the lowest, leftmost node that they see.
        pub bins: Bins,
        /// Points by the cell of the background grid.
        pub cells: Bins,
        /// Sums of V_p and of V_p tr L_p over the points of each cell.
        pub cell_sum: Pointer<Vector>,
    }
}

impl From<&Vec2> for Vector {
    fn from(v: &Vec2) -> Self {
        Self { x: v.x, y: v.y }
    }
}

impl From<Vector> for Vec2 {
    fn from(v: Vector) -> Self {
        Self::new(v.x, v.y)
    }
}

impl From<&Mat2> for Matrix {
    fn from(m: &Mat2) -> Self {
        Self { xx: m.m11, xy: m.m12, yx: m.m21, yy: m.m22 }
    }
}

impl From<Matrix> for Mat2 {
    fn from(m: Matrix) -> Self {
        Self::new(m.xx, m.xy, m.yx, m.yy)
    }
}

impl From<&crate::Obstacle> for Obstacle {
    fn from(o: &crate::Obstacle) -> Self {
        Self {
            min: o.min.into(),
            max: o.max.into(),
            friction: frictions(&o.faces),
            velocity: o.velocity.into(),
            start: o.start,
        }
    }
}

/// Coefficients of friction of the left, right, bottom and top side: 0 slips, infinity sticks.
pub(super) fn frictions(walls: &Walls) -> [f64; 4] {
    walls.sides().map(|friction| match friction {
        Friction::Slip => 0.0,
        Friction::Coulomb(mu) => mu,
        Friction::Stick => f64::INFINITY,
    })
}
