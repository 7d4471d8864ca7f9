//! Estimates of density and wave speed before packings are prepared.

use dem::Grains;
use mpm::ElasticParameters;

use super::model::{Discs, Domain, Material, Precision, Rve, Scene};

/// Solid fraction of a dense packing of discs.
pub const SOLID_FRACTION: f64 = 0.84;
/// Contacts per disc of a dense packing.
pub const COORDINATION: f64 = 4.0;
/// Largest macro step over the time that a wave needs through a cell. With quadratic splines and GIMP
/// it is safe for every arrangement of points, including isolated ones.
pub const COURANT: f64 = 0.5;
/// Largest distance that a point may move in a step, in cells.
pub const CROSSING: f64 = 0.2;

impl Material {
    /// Bulk density (kg/m³).
    pub fn density(&self) -> f64 {
        match self {
            Self::Discs(discs) => discs.grains.grain_density * SOLID_FRACTION,
            Self::Rve(rve) => rve.parameters.grains.grain_density * SOLID_FRACTION,
            Self::MuI(law) => law.density,
            Self::Elastic(law) => law.density,
        }
    }

    /// Modulus of plane compression waves (Pa).
    pub fn wave_modulus(&self) -> f64 {
        match self {
            Self::Discs(discs) => voigt_modulus(&discs.grains),
            Self::Rve(rve) => voigt_modulus(&rve.parameters.grains),
            Self::MuI(law) => law.wave_modulus(),
            Self::Elastic(law) => ElasticParameters::from(law).wave_modulus(),
        }
    }

    /// Speed of compression waves (m/s).
    pub fn wave_speed(&self) -> f64 {
        (self.wave_modulus() / self.density()).sqrt()
    }

    /// Diameter (m) and density (kg/m³) of grains for the inertial number; zero without grains.
    pub fn grain(&self) -> (f64, f64) {
        match self {
            Self::Discs(Discs { grains, .. }) => (grains.mean_diameter(), grains.grain_density),
            Self::Rve(rve) => {
                let grains = &rve.parameters.grains;
                (grains.mean_diameter(), grains.grain_density)
            }
            Self::MuI(law) => (law.grain_diameter, law.grain_density),
            Self::Elastic(_) => (0.0, 0.0),
        }
    }
}

/// Mean-field (Voigt) modulus `M = (3 kn + kt) / 8 * 2 Z phi / (pi t)` (Pa): a packing responds with it to a
/// sudden affine strain, and relaxes from there.
fn voigt_modulus(grains: &Grains) -> f64 {
    let fabric = 2.0 * COORDINATION * SOLID_FRACTION / std::f64::consts::PI;
    (3.0 * grains.normal_stiffness + grains.tangential_stiffness) / 8.0 * fabric / grains.thickness
}

/// Mean area of a disc (m²).
fn mean_area(grains: &Grains) -> f64 {
    let (a, b) = (grains.radius_min, grains.radius_max);
    std::f64::consts::PI * (a * a + a * b + b * b) / 3.0
}

impl Rve {
    /// Side of the square RVE (m): `N pi <r²> / phi` is its area.
    pub fn side(&self) -> f64 {
        let p = &self.parameters;
        (p.discs as f64 * mean_area(&p.grains) / SOLID_FRACTION).sqrt()
    }
}

impl Discs {
    /// Discs in an area (m²) of dense packing, about.
    pub fn count_in(&self, area: f64) -> f64 {
        area * SOLID_FRACTION / mean_area(&self.grains)
    }

    /// Memory for so many discs, with what searches and frames need besides (bytes); measured.
    pub fn memory(&self, discs: f64) -> f64 {
        let bytes = match self.precision {
            Precision::F32 => 1500.0,
            Precision::F64 => 2000.0,
        };
        bytes * discs
    }
}

impl Domain {
    /// Initial distance between neighbouring material points (m).
    pub fn spacing(&self) -> f64 {
        self.cell / self.points_per_cell as f64
    }

    /// Cells along x and y.
    pub fn cells(&self) -> [usize; 2] {
        self.size.map(|size| (size / self.cell).round() as usize)
    }
}

impl Scene {
    /// Largest stable macro step of the MPM (s), in which a wave crosses half a cell.
    pub fn step_limit(&self) -> f64 {
        COURANT * self.domain.cell / self.material.wave_speed()
    }
}
