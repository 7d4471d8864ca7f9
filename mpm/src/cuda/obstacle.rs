//! Arguments of `obstacle.cu`.

use gpu::kernel;

use super::abi::Mpm;

kernel! {
    /// Counts the step and places the obstacles; one block of one warp.
    pub struct BeginStep: begin_step {
        /// The solver.
        pub m: Mpm,
    }
}
