//! Arguments of `g2p.cu`: grid to points.

use gpu::kernel;

use super::abi::Mpm;

kernel! {
    /// Velocity, affine matrix and position of all points, kept out of walls and obstacles.
    pub struct G2p: g2p {
        /// The solver.
        pub m: Mpm,
    }
}
