//! The numerical scheme and its options.

use serde::{Deserialize, Serialize};

use crate::basis::Basis;
use crate::error::Error;

/// When in a step stresses are updated, and from which grid velocity.
///
/// The material is called exactly once a step in each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scheme {
    /// Modified update stress last: the new point velocities are mapped to the grid once more and
    /// give the velocity gradient. Free of the small-mass trouble of [`Usl`](Self::Usl).
    /// Sulsky, Zhou & Schreyer (1995), Comput. Phys. Commun. 87, 236.
    #[default]
    Musl,
    /// Update stress last: velocity gradient from `v_i^{n+1}`. Dissipates high frequencies.
    Usl,
    /// Update stress first: velocity gradient from `v_i^n`, before the forces. Conserves energy
    /// best. Bardenhagen (2002), J. Comput. Phys. 180, 383.
    Usf,
}

/// How velocities go from the grid to the points.
///
/// A PIC share of `s` per step is a viscosity `s dx² / (4 dt)` (quadratic splines), so a share
/// chosen as a number would change its meaning with the step. It is therefore given as a rate
/// `beta` (1/s): the share is `beta dt`, at most 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Transfer {
    /// FLIP velocity relaxed towards the APIC velocity at `rate` (1/s); the affine term always
    /// takes part in P2G. As quiet as APIC while its dissipation converges with the step.
    FlipApic {
        /// `beta` (1/s).
        rate: f64,
    },
    /// FLIP velocity relaxed towards the PIC velocity at `rate` (1/s).
    /// Brackbill & Ruppel (1986), J. Comput. Phys. 65, 314.
    Flip {
        /// `beta` (1/s).
        rate: f64,
    },
    /// Affine particle in cell. Jiang, Schroeder, Selle, Teran & Stomakhin (2015), ACM Trans.
    /// Graph. 34, 51.
    Apic,
    /// Particle in cell: filters velocity every step.
    Pic,
}

impl Default for Transfer {
    fn default() -> Self {
        Self::FlipApic { rate: 500.0 }
    }
}

impl Transfer {
    /// Share of the grid velocity itself (PIC) in the new point velocity; the rest is FLIP.
    pub(crate) fn pic_share(self, dt: f64) -> f64 {
        match self {
            Self::FlipApic { rate } | Self::Flip { rate } => (rate * dt).min(1.0),
            Self::Apic | Self::Pic => 1.0,
        }
    }

    /// Whether points carry the affine velocity matrix.
    pub(crate) fn affine(self) -> bool {
        matches!(self, Self::FlipApic { .. } | Self::Apic)
    }
}

/// When material feels walls and boxes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WallContact {
    /// Nodes on and behind a wall or in a box never move into it. A point feels them as soon as its basis functions
    /// reach such a node, 1.5 cells away with quadratic splines.
    #[default]
    Nodes,
    /// These nodes may approach until the nearest point in their support touches: at half the side of a square of
    /// its volume.
    Points,
}

/// The numerical scheme. The default suits dense granular flow.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Numerics {
    /// Basis functions of the grid.
    pub basis: Basis,
    /// When stresses are updated.
    pub scheme: Scheme,
    /// How velocities go from the grid to the points.
    pub transfer: Transfer,
    /// When material feels walls and boxes.
    pub wall_contact: WallContact,
    /// Replaces `tr L` of every point by the volume-weighted mean over its cell, against
    /// volumetric locking (B-bar).
    pub cell_average_volumetric: bool,
    /// Rate (1/s) at which the material of a point is compressed where points stand closer together than their
    /// volumes allow; 0: not at all.
    pub density_correction: f64,
    /// Width of shocks (cells): `w` in the pressure `rho (w h tr L)²` against compression, which ends the ringing
    /// behind a shock (von Neumann and Richtmyer 1950, J. Appl. Phys. 21, 232). It grows with the square of the rate,
    /// so that flow does not feel it.
    pub shock_width: f64,
    /// Nodes lighter than this fraction of the mean point mass are left at rest.
    pub mass_cutoff: f64,
}

impl Default for Numerics {
    fn default() -> Self {
        Self {
            basis: Basis::default(),
            scheme: Scheme::default(),
            transfer: Transfer::default(),
            wall_contact: WallContact::default(),
            cell_average_volumetric: false,
            density_correction: 0.0,
            shock_width: 0.0,
            mass_cutoff: 1.0e-10,
        }
    }
}

impl Numerics {
    /// Largest mass of a node left at rest (kg/m), for points of this total mass.
    pub(crate) fn cutoff(&self, mass: f64, points: usize) -> f64 {
        self.mass_cutoff * mass / points.max(1) as f64
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        if let Transfer::FlipApic { rate } | Transfer::Flip { rate } = self.transfer
            && !(rate.is_finite() && rate >= 0.0)
        {
            return Err(Error::Numerics(format!("transfer rate {rate} 1/s is not a number >= 0")));
        }
        let rate = self.density_correction;
        if !(rate.is_finite() && rate >= 0.0) {
            return Err(Error::Numerics(format!(
                "density_correction {rate} 1/s is not a number >= 0"
            )));
        }
        let width = self.shock_width;
        if !(width.is_finite() && width >= 0.0) {
            return Err(Error::Numerics(format!("shock_width {width} is not a number >= 0")));
        }
        if !(self.mass_cutoff >= 0.0 && self.mass_cutoff < 1.0) {
            return Err(Error::Numerics(format!(
                "mass_cutoff {} is not in [0, 1)",
                self.mass_cutoff
            )));
        }
        Ok(())
    }
}
