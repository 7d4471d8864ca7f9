//! Arguments of `velocity_gradient.cu`.

use gpu::kernel;

use super::abi::Mpm;

kernel! {
    /// Velocity gradients of all points.
    pub struct VelocityGradient: velocity_gradient {
        /// The solver.
        pub m: Mpm,
    }
}
