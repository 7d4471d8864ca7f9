//! Isotropic elasticity in plane strain.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Material, MaterialError, require, rotated, strain_rate, stretched};
use crate::{Mat2, PARALLEL_GRAIN};

/// Parameters of [`Elastic`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ElasticParameters {
    /// Young's modulus `E` (Pa).
    pub young_modulus: f64,
    /// Poisson's ratio `nu`.
    pub poisson_ratio: f64,
}

impl Default for ElasticParameters {
    fn default() -> Self {
        Self { young_modulus: 1.0e6, poisson_ratio: 0.2 }
    }
}

impl ElasticParameters {
    /// Lamé's first constant `lambda = E nu / ((1 + nu)(1 - 2 nu))` (Pa).
    pub fn lambda(&self) -> f64 {
        let nu = self.poisson_ratio;
        self.young_modulus * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
    }

    /// Shear modulus `G = E / (2 (1 + nu))` (Pa).
    pub fn shear_modulus(&self) -> f64 {
        self.young_modulus / (2.0 * (1.0 + self.poisson_ratio))
    }

    /// P-wave modulus `M = lambda + 2 G` (Pa).
    pub fn wave_modulus(&self) -> f64 {
        self.lambda() + 2.0 * self.shear_modulus()
    }
}

/// Hypoelastic law in plane strain with the Jaumann rate of Cauchy stress:
///
/// $$ \dot{\boldsymbol\sigma} = \lambda \operatorname{tr}(\mathbf D) \mathbf I + 2 G \mathbf D
/// + \mathbf W \boldsymbol\sigma - \boldsymbol\sigma \mathbf W. $$
///
/// Hooke's law at small strain, objective under any rotation. In uniaxial strain
/// $\sigma = M \ln F$.
///
/// A block that swings under its weight:
///
/// ```
/// use mpm::{Domain, Elastic, ElasticParameters, Numerics, Points, Solver, Vec2, Walls};
///
/// let domain = Domain { size: Vec2::new(1.0, 1.0), walls: Walls::default(), cell: 0.125 };
/// let mut points = Points::rectangle(Vec2::zeros(), Vec2::new(1.0, 0.5), 0.0625, 1000.0);
/// let mut block = Elastic::new(ElasticParameters::default())?;
/// let mut solver = Solver::new(domain, Numerics::default(), Vec2::new(0.0, -9.81), vec![])?;
/// for _ in 0..20 {
///     solver.advance(&mut points, &mut block, 2.0e-4)?;
/// }
/// // The lowest row of points is compressed.
/// assert!(points.stress[0][(1, 1)] < 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Elastic {
    parameters: ElasticParameters,
}

impl Elastic {
    /// The law with these parameters.
    pub fn new(parameters: ElasticParameters) -> Result<Self, MaterialError> {
        let ElasticParameters { young_modulus: e, poisson_ratio: nu } = parameters;
        require(e > 0.0 && e.is_finite(), "young_modulus", e, "a positive number")?;
        require(nu > -1.0 && nu < 0.5, "poisson_ratio", nu, "between -1 and 0.5")?;
        Ok(Self { parameters })
    }

    /// Its parameters.
    pub fn parameters(&self) -> &ElasticParameters {
        &self.parameters
    }
}

impl Material for Elastic {
    fn update(
        &mut self,
        dt: f64,
        velocity_gradient: &[Mat2],
        stress: &mut [Mat2],
        volume: &mut [f64],
    ) -> Result<(), MaterialError> {
        let (lambda, g) = (self.parameters.lambda(), self.parameters.shear_modulus());
        (velocity_gradient, stress, volume).into_par_iter().with_min_len(PARALLEL_GRAIN).for_each(
            |(l, stress, volume)| {
                let d = strain_rate(l);
                let rate = Mat2::identity() * (lambda * d.trace()) + d * (2.0 * g);
                *stress = rotated(stress, l, dt) + rate * dt;
                *volume = stretched(*volume, l, dt);
            },
        );
        Ok(())
    }

    fn wave_modulus(&self, _point: usize) -> f64 {
        self.parameters.wave_modulus()
    }
}
