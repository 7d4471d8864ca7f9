//! Arguments of `drucker_prager.cu`.

use gpu::{Pointer, cuda_struct, kernel};

use super::abi::Mpm;
use crate::DruckerPragerParameters;

cuda_struct! {
    /// [`DruckerPragerParameters`] of a step.
    pub struct DruckerPragerLaw {
        /// In-plane bulk modulus (Pa).
        pub bulk_modulus: f64,
        /// Shear modulus (Pa).
        pub shear_modulus: f64,
        /// Friction at inertial number 0.
        pub static_friction: f64,
        /// Friction at infinite inertial number.
        pub dynamic_friction: f64,
        /// Inertial number at which friction is half way between the two.
        pub inertial_number: f64,
        /// Mean diameter of the grains (m).
        pub grain_diameter: f64,
        /// Density of the grains (kg/m³).
        pub grain_density: f64,
    }
}

kernel! {
    /// Stress and volume of all points after a step (`drucker_prager.cu`).
    pub struct DruckerPragerUpdate: drucker_prager {
        /// The solver.
        pub m: Mpm,
        /// Parameters of the law.
        pub law: DruckerPragerLaw,
        /// Logarithmic volume strain of each point since its stress-free dense state.
        pub volume_strain: Pointer<f64>,
    }
}

impl From<&DruckerPragerParameters> for DruckerPragerLaw {
    fn from(p: &DruckerPragerParameters) -> Self {
        Self {
            bulk_modulus: p.bulk_modulus,
            shear_modulus: p.shear_modulus,
            static_friction: p.static_friction,
            dynamic_friction: p.dynamic_friction,
            inertial_number: p.inertial_number,
            grain_diameter: p.grain_diameter,
            grain_density: p.grain_density,
        }
    }
}
