//! Grains, their contact law and its integration: the same for packings and for whole scenes.

use serde::{Deserialize, Serialize};

/// Grains, contact law and numerics of every DEM computation, of packings as of whole scenes.
///
/// All units are SI. Discs are cylinders of height [`thickness`](Self::thickness), so masses are
/// true masses (kg) and stresses true stresses (Pa).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Grains {
    /// Smallest disc radius (m); radii are uniform in `[radius_min, radius_max]`.
    pub radius_min: f64,
    /// Largest disc radius (m).
    pub radius_max: f64,
    /// Density of the grain material (kg/m³).
    pub grain_density: f64,
    /// Out-of-plane thickness `t` (m). Stress is force per length divided by `t`; the default is
    /// the mean disc diameter, one layer of grains.
    pub thickness: f64,
    /// Normal contact stiffness `kn` (N/m).
    pub normal_stiffness: f64,
    /// Tangential contact stiffness `kt` (N/m).
    pub tangential_stiffness: f64,
    /// Coulomb friction coefficient between grains.
    pub friction: f64,
    /// Coefficient of rolling friction: contacts resist rolling with a torque up to this times the normal force
    /// and the reduced radius. 0: discs roll freely.
    pub rolling_friction: f64,
    /// Stiffness of contacts against rolling `kr` (N/m).
    pub rolling_stiffness: f64,
    /// Dashpots `zeta` of the normal and the rolling spring, as a fraction of critical damping of a pair.
    pub damping_ratio: f64,
    /// Cundall local damping `alpha` in flow. Not neutral in flow (it raises the shear strength at
    /// high inertial number), hence 0 by default.
    pub local_damping: f64,
    /// Grain mass is multiplied by this in the equations of motion (not in the bulk density): a
    /// larger step at the price of a larger inertial number. 1 is physical.
    pub mass_scale: f64,
    /// DEM step as a fraction of `sqrt(m_min / max(kn, kt))`, with `kr` where contacts resist rolling. A packing
    /// becomes unstable near 0.55.
    pub step_factor: f64,
    /// Verlet skin as a fraction of the largest radius.
    pub skin: f64,
    /// Overlaps larger than this fraction of the smaller radius are counted and reported.
    pub overlap_warning: f64,
    /// An overlap larger than this fraction of the smaller radius ends the run.
    pub overlap_limit: f64,
    /// Friction while grains are prepared: about 0 gives a dense packing, 0.1 a medium one, the
    /// friction of flow a loose one.
    pub preparation_friction: f64,
}

impl Default for Grains {
    fn default() -> Self {
        Self {
            radius_min: 2.5e-3,
            radius_max: 5.0e-3,
            grain_density: 2650.0,
            thickness: 7.5e-3,
            normal_stiffness: 1.0e5,
            tangential_stiffness: 1.0e5,
            friction: 0.5,
            rolling_friction: 0.0,
            rolling_stiffness: 1.0e5,
            damping_ratio: 0.2,
            local_damping: 0.0,
            mass_scale: 1.0,
            // At 0.2, 1e-4 s would take 8.004 steps, which is 9.
            step_factor: 0.201,
            skin: 0.3,
            overlap_warning: 0.15,
            overlap_limit: 1.0,
            preparation_friction: 1.0e-3,
        }
    }
}

impl Grains {
    /// Mass of a disc of radius `r` (kg): `rho pi r² t`.
    pub fn disc_mass(&self, r: f64) -> f64 {
        self.grain_density * std::f64::consts::PI * r * r * self.thickness
    }

    /// Whether contacts resist rolling.
    pub fn resist_rolling(&self) -> bool {
        self.rolling_friction != 0.0
    }

    /// Largest DEM step used (s): `step_factor * sqrt(mass_scale m_min / max(kn, kt, kr))`; `kr` only where
    /// contacts resist rolling.
    ///
    /// The rotation of the lightest grain governs; packings were found unstable above
    /// `0.55 sqrt(m_min / kn)`.
    pub fn step(&self) -> f64 {
        let m_min = self.mass_scale * self.disc_mass(self.radius_min);
        let rolling = if self.resist_rolling() { self.rolling_stiffness } else { 0.0 };
        let stiffest = self.normal_stiffness.max(self.tangential_stiffness).max(rolling);
        self.step_factor * (m_min / stiffest).sqrt()
    }

    /// These grains with the step factor of preparations, always the default: what is prepared does not depend on the
    /// step of flow.
    #[must_use]
    pub fn in_preparation(&self) -> Self {
        Self { step_factor: Self::default().step_factor, ..self.clone() }
    }

    /// DEM step of preparations (s), with physical masses.
    pub fn preparation_step(&self) -> f64 {
        Self { mass_scale: 1.0, ..self.in_preparation() }.step()
    }

    /// Substeps in a macro step of `dt`: `ceil(dt / step())`, at least 1.
    pub fn substeps(&self, dt: f64) -> usize {
        // The tolerance keeps dt = n * step() from becoming n + 1 by round-off.
        ((dt / self.step() - 1.0e-9).ceil() as usize).max(1)
    }

    /// Mean disc diameter (m).
    pub fn mean_diameter(&self) -> f64 {
        self.radius_min + self.radius_max
    }

    /// Pressure (Pa) under which stress in f32 may be more than a per cent wrong.
    ///
    /// Overlaps come from distances of about a diameter, known to `eps d`. At this pressure, the mean
    /// overlap `delta` of `p t = Z phi kn delta / (2 pi r)`, with `Z = 4` and `phi = 0.84`, is a
    /// hundred times that. Errors of many contacts cancel in part: packings were measured to be a
    /// per cent wrong at 10 to 100 Pa where this gives 170 Pa.
    pub fn single_precision_pressure(&self) -> f64 {
        let fabric = 4.0 * 0.84 / (2.0 * std::f64::consts::PI);
        let overlap = 100.0 * f64::from(f32::EPSILON) * self.mean_diameter();
        fabric * self.normal_stiffness * overlap / (0.5 * self.mean_diameter() * self.thickness)
    }

    /// Stiffness number `kappa = kn / (p t)` at pressure `p` (Pa).
    pub fn stiffness_number(&self, p: f64) -> f64 {
        self.normal_stiffness / (p * self.thickness)
    }
}
