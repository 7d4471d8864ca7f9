//! Strength of packings of discs.

/// A shear test of an independent prototype with the same discs and contact law.
pub struct Shear {
    /// Shear rate, 1/s.
    pub rate: f64,
    /// Inertial number.
    pub inertial_number: f64,
    /// Ratio of shear stress to pressure.
    pub strength: f64,
    /// Solid fraction.
    pub solid_fraction: f64,
    /// Contacts per disc.
    pub coordination: f64,
}

const fn shear(
    rate: f64,
    [inertial_number, strength, solid_fraction, coordination]: [f64; 4],
) -> Shear {
    Shear { rate, inertial_number, strength, solid_fraction, coordination }
}

/// Shear tests of the prototype.
pub const SHEAR: [Shear; 4] = [
    shear(0.4, [0.0011, 0.277, 0.812, 2.95]),
    shear(4.0, [0.011, 0.303, 0.8097, 2.69]),
    shear(40.0, [0.109, 0.405, 0.780, 1.67]),
    shear(120.0, [0.328, 0.52, 0.719, 0.98]),
];

/// Largest sin phi in biaxial compression of a dense packing, by the prototype.
pub const PEAK_SIN_PHI: f64 = 0.458;
/// Critical state in biaxial compression, by the prototype: sin phi.
pub const CRITICAL_SIN_PHI: f64 = 0.28;
/// Its solid fraction.
pub const CRITICAL_SOLID_FRACTION: f64 = 0.813;
/// Its contacts per disc.
pub const CRITICAL_COORDINATION: f64 = 3.05;

/// Friction of discs over the inertial number, by da Cruz et al. (2005), up to 0.2.
pub fn da_cruz(inertial_number: f64) -> f64 {
    0.25 + 1.1 * inertial_number
}
