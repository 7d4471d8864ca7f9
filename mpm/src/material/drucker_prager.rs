//! Dense granular flow: in-plane Drucker–Prager yield with the mu(I) friction law.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Material, MaterialError, require, rotated, strain_rate, stretched};
use crate::{Mat2, PARALLEL_GRAIN};

/// Parameters of [`DruckerPrager`]. The defaults are fitted to dense discs in the plane with contact friction 0.5, at
/// 10 kPa (`dempm calibrate scenes/calibrate/default-grains.toml --law mu-i`).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DruckerPragerParameters {
    /// In-plane bulk modulus `K` (Pa).
    pub bulk_modulus: f64,
    /// Shear modulus `G` (Pa).
    pub shear_modulus: f64,
    /// Bulk density `rho` (kg/m³) of the initial state.
    pub density: f64,
    /// Quasi-static friction `mu_s = sin phi` at inertial number 0.
    pub static_friction: f64,
    /// Friction `mu_2` at infinite inertial number; equal to `static_friction` for a constant one.
    pub dynamic_friction: f64,
    /// Inertial number `I_0` at which friction is half way between the two.
    pub inertial_number: f64,
    /// Mean grain diameter `d` (m).
    pub grain_diameter: f64,
    /// Density `rho_s` of the grains (kg/m³).
    pub grain_density: f64,
}

impl Default for DruckerPragerParameters {
    fn default() -> Self {
        Self {
            bulk_modulus: 6.5e6,
            shear_modulus: 4.1e6,
            density: 2234.0,
            static_friction: 0.288,
            dynamic_friction: 0.815,
            inertial_number: 0.395,
            grain_diameter: 7.5e-3,
            grain_density: 2650.0,
        }
    }
}

impl DruckerPragerParameters {
    /// The same law with friction `sin phi` at every rate.
    pub fn with_constant_friction(self, sin_phi: f64) -> Self {
        Self { static_friction: sin_phi, dynamic_friction: sin_phi, ..self }
    }

    /// `sin phi(I) = mu_s + (mu_2 - mu_s) I / (I_0 + I)`.
    /// Jop, Forterre & Pouliquen (2006), Nature 441, 727.
    pub fn friction(&self, inertial_number: f64) -> f64 {
        self.static_friction
            + (self.dynamic_friction - self.static_friction) * inertial_number
                / (self.inertial_number + inertial_number)
    }

    /// P-wave modulus `M = K + G` (Pa).
    pub fn wave_modulus(&self) -> f64 {
        self.bulk_modulus + self.shear_modulus
    }

    fn check(&self) -> Result<(), MaterialError> {
        for (name, value) in [
            ("bulk_modulus", self.bulk_modulus),
            ("shear_modulus", self.shear_modulus),
            ("density", self.density),
            ("inertial_number", self.inertial_number),
            ("grain_diameter", self.grain_diameter),
            ("grain_density", self.grain_density),
        ] {
            require(value > 0.0 && value.is_finite(), name, value, "a positive number")?;
        }
        for (name, value) in
            [("static_friction", self.static_friction), ("dynamic_friction", self.dynamic_friction)]
        {
            require(
                (0.0..1.0).contains(&value),
                name,
                value,
                "in [0, 1), as the sine of an angle",
            )?;
        }
        Ok(())
    }
}

/// Elastic-plastic law of a cohesionless granular material, isochoric in shear.
///
/// With compression `p` positive, in the plane:
///
/// $$ p = K \max(0, -J), \qquad J = \int \operatorname{tr} \mathbf L \mathrm d t, $$
/// $$ \overset{\circ}{\mathbf s} = 2 G \mathbf D', \qquad
/// |\mathbf s| = \sqrt{\mathbf s : \mathbf s / 2} \le p \sin \varphi(I), $$
///
/// with the deviators $\mathbf s$ and $\mathbf D'$ of stress and strain rate, the Jaumann rate of $\mathbf s$, and the
/// inertial number $I = \dot\gamma d \sqrt{\rho_s / p}$ at the shear rate
/// $\dot\gamma = \sqrt{2 \mathbf D' : \mathbf D'}$.
///
/// A state beyond yield is scaled back along $\mathbf s$. Material that was pulled apart, $J > 0$, stays free of
/// stress until the gap is closed again (Dunatunga & Kamrin 2015, J. Fluid Mech. 779, 483).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DruckerPrager {
    parameters: DruckerPragerParameters,
    /// Logarithmic volume strain `J_e` of each point since its stress-free dense state.
    pub(crate) volume_strain: Vec<f64>,
}

impl DruckerPrager {
    /// The law for points of this initial stress (Pa). Tension is taken as no stress.
    pub fn new(
        parameters: DruckerPragerParameters,
        stress: &[Mat2],
    ) -> Result<Self, MaterialError> {
        parameters.check()?;
        let strain = |s: &Mat2| (0.5 * s.trace() / parameters.bulk_modulus).min(0.0);
        Ok(Self { parameters, volume_strain: stress.iter().map(strain).collect() })
    }

    /// Its parameters.
    pub fn parameters(&self) -> &DruckerPragerParameters {
        &self.parameters
    }

    /// Logarithmic volume strain of each point since its stress-free dense state; positive where
    /// grains are apart.
    pub fn volume_strain(&self) -> &[f64] {
        &self.volume_strain
    }
}

impl Material for DruckerPrager {
    fn update(
        &mut self,
        dt: f64,
        velocity_gradient: &[Mat2],
        stress: &mut [Mat2],
        volume: &mut [f64],
    ) -> Result<(), MaterialError> {
        let (expected, found) = (self.volume_strain.len(), stress.len());
        if found != expected {
            return Err(MaterialError::Length { expected, found });
        }
        let law = &self.parameters;
        (velocity_gradient, stress, volume, &mut self.volume_strain)
            .into_par_iter()
            .with_min_len(PARALLEL_GRAIN)
            .for_each(|(l, stress, volume, strain)| {
                *strain += dt * l.trace();
                *volume = stretched(*volume, l, dt);
                *stress = law.stress(*strain, stress, l, dt);
            });
        Ok(())
    }

    fn wave_modulus(&self, _point: usize) -> f64 {
        self.parameters.wave_modulus()
    }
}

impl DruckerPragerParameters {
    /// Stress after a step that ends at volume strain `strain`.
    fn stress(&self, strain: f64, old: &Mat2, l: &Mat2, dt: f64) -> Mat2 {
        let p = -self.bulk_modulus * strain;
        if p <= 0.0 {
            return Mat2::zeros();
        }
        let rate = deviator(&strain_rate(l));
        let trial = deviator(&rotated(old, l, dt)) + rate * (2.0 * self.shear_modulus * dt);

        // |D| = sqrt(D : D / 2), so gamma = sqrt(2 D : D) = 2 |D|.
        let shear_rate = 2.0 * in_plane_norm(&rate);
        let inertial = shear_rate * self.grain_diameter * (self.grain_density / p).sqrt();
        let strength = p * self.friction(inertial);
        let size = in_plane_norm(&trial);
        let scale = if size > strength { strength / size } else { 1.0 };
        trial * scale - Mat2::identity() * p
    }
}

fn deviator(m: &Mat2) -> Mat2 {
    m - Mat2::identity() * (0.5 * m.trace())
}

/// `sqrt(s : s / 2)`: radius of Mohr's circle of a deviator.
fn in_plane_norm(s: &Mat2) -> f64 {
    s.norm() * std::f64::consts::FRAC_1_SQRT_2
}
