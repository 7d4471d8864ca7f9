//! Arguments of `density.cu`.

use gpu::kernel;

use super::abi::Mpm;

kernel! {
    /// Compresses the material of points where the grid is denser than it.
    pub struct CorrectDensity: correct_density {
        /// The solver.
        pub m: Mpm,
    }
}
