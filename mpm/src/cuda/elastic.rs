//! Arguments of `elastic.cu`.

use gpu::kernel;

use super::abi::Mpm;

kernel! {
    /// Stress and volume of all points after a step (`elastic.cu`).
    pub struct ElasticUpdate: elastic {
        /// The solver.
        pub m: Mpm,
        /// Lamé's first constant (Pa).
        pub lambda: f64,
        /// Shear modulus (Pa).
        pub shear_modulus: f64,
    }
}
