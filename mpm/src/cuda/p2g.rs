//! Arguments of `p2g.cu`: points to grid.

use gpu::kernel;

use super::abi::Mpm;

kernel! {
    /// MUSL and USL: mass, momentum and force of all nodes, and their balance of momentum.
    pub struct P2g: p2g {
        /// The solver.
        pub m: Mpm,
    }

    /// USF, before the update of stresses: mass, momentum and velocity before the step.
    pub struct P2gMassAndMomentum: p2g_mass_and_momentum {
        /// The solver.
        pub m: Mpm,
    }

    /// USF, after the update of stresses: force and balance of momentum.
    pub struct P2gInternalForce: p2g_internal_force {
        /// The solver.
        pub m: Mpm,
    }

    /// MUSL: velocity of the nodes from the new velocities of the points, still at the old positions.
    pub struct P2gVelocity: p2g_velocity {
        /// The solver.
        pub m: Mpm,
    }
}

/// Threads that work on one node; `LANES` in the kernels.
pub(super) const LANES: usize = 16;
