//! Constitutive laws.

mod drucker_prager;
mod elastic;

pub use drucker_prager::{DruckerPrager, DruckerPragerParameters};
pub use elastic::{Elastic, ElasticParameters};

use crate::Mat2;

/// Constitutive response of all points at once. Called from a thread of rayon's pool.
pub trait Material: Send {
    /// Advances all points by `dt` (s) at constant `velocity_gradient` (1/s, `L_ij = dv_i/dx_j`):
    /// updates `stress` (Cauchy, Pa, tension positive) and `volume` (m²). All slices have one
    /// entry a point, in the same order in every call. Called once a step.
    fn update(
        &mut self,
        dt: f64,
        velocity_gradient: &[Mat2],
        stress: &mut [Mat2],
        volume: &mut [f64],
    ) -> Result<(), MaterialError>;

    /// P-wave modulus `M = C_1111` of a point (Pa), for bounds on the step.
    fn wave_modulus(&self, point: usize) -> f64;
}

/// Why a material could not be made or updated.
#[derive(Debug, thiserror::Error)]
pub enum MaterialError {
    /// A parameter is out of range.
    #[error("material parameter `{name}` = {value} must be {requirement}")]
    Parameter {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Values it may have.
        requirement: &'static str,
    },
    /// The number of points has changed.
    #[error("the material holds the state of {expected} points and was given {found}")]
    Length {
        /// Points of the material.
        expected: usize,
        /// Points of the solver.
        found: usize,
    },
    /// The response of a point could not be computed.
    #[error("material of point {point}: {reason}")]
    Point {
        /// Its index.
        point: usize,
        /// Why.
        reason: String,
    },
    /// An error of another library that computes the response.
    #[error(transparent)]
    Other(Box<dyn std::error::Error + Send + Sync>),
}

/// Parameter checks; a NaN fails them all.
fn require(
    ok: bool,
    name: &'static str,
    value: f64,
    requirement: &'static str,
) -> Result<(), MaterialError> {
    if ok { Ok(()) } else { Err(MaterialError::Parameter { name, value, requirement }) }
}

/// Strain rate `D = sym L`.
fn strain_rate(l: &Mat2) -> Mat2 {
    (l + l.transpose()) * 0.5
}

/// Stress turned by the spin of a step: `R s R^T`, `R = exp(W dt)`, `W = skew L`. This is the
/// Jaumann rate integrated exactly over a constant spin, so a rigid rotation only turns the stress.
fn rotated(stress: &Mat2, l: &Mat2, dt: f64) -> Mat2 {
    let angle = 0.5 * (l[(1, 0)] - l[(0, 1)]) * dt;
    let (sin, cos) = angle.sin_cos();
    let r = Mat2::new(cos, -sin, sin, cos);
    r * stress * r.transpose()
}

/// Volume after a step at constant `L`: `V exp(dt tr L)`, since `det exp(L dt) = exp(dt tr L)`.
fn stretched(volume: f64, l: &Mat2, dt: f64) -> f64 {
    volume * (dt * l.trace()).exp()
}
