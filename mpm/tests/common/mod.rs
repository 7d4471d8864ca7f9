//! What several tests set up.
#![allow(dead_code, reason = "each test uses a part")]

use mpm::{
    Basis, Domain, Elastic, ElasticParameters, Mat2, Material, MaterialError, Numerics, Points,
    Scheme, Solver, Transfer, Vec2, Walls,
};

pub const GRAVITY: f64 = 9.81;

/// FLIP without any relaxation: no dissipation beyond the grid's own.
pub fn flip(basis: Basis, scheme: Scheme) -> Numerics {
    Numerics { basis, scheme, transfer: Transfer::Flip { rate: 0.0 }, ..Numerics::default() }
}

/// A solver in a box with smooth walls.
pub fn smooth_box(size: Vec2, cell: f64, numerics: Numerics, gravity: Vec2) -> Solver {
    Solver::new(Domain { size, walls: Walls::default(), cell }, numerics, gravity, vec![]).unwrap()
}

pub fn elastic(young_modulus: f64, poisson_ratio: f64) -> Elastic {
    Elastic::new(ElasticParameters { young_modulus, poisson_ratio }).unwrap()
}

/// A disc cut out of a square lattice of points.
pub fn disc(centre: Vec2, radius: f64, spacing: f64, density: f64) -> Points {
    let corner = Vec2::new(radius, radius);
    let square = Points::rectangle(centre - corner, centre + corner, spacing, density);
    let mut disc = Points::default();
    for p in (0..square.len()).filter(|&p| (square.position[p] - centre).norm() < radius) {
        disc.push(square.position[p], square.mass[p], square.volume[p]);
    }
    disc
}

pub fn centre_of_mass(points: &Points) -> Vec2 {
    let moment: Vec2 = points.position.iter().zip(&points.mass).map(|(x, m)| x * *m).sum();
    moment / points.mass.iter().sum::<f64>()
}

/// Material without any stress: points move by inertia and gravity alone.
pub struct Dust;

impl Material for Dust {
    fn update(
        &mut self,
        _: f64,
        _: &[Mat2],
        _: &mut [Mat2],
        _: &mut [f64],
    ) -> Result<(), MaterialError> {
        Ok(())
    }

    fn wave_modulus(&self, _: usize) -> f64 {
        0.0
    }
}

/// Root of the mean of squares.
pub fn rms(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = values.len() as f64;
    (values.map(|v| v * v).sum::<f64>() / n).sqrt()
}
