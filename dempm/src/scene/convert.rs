//! A scene in the types of the material point method.

use mpm::{ElasticParameters, Solver, Vec2};

use super::model::{Elastic, Rectangle, Scene};

impl Scene {
    /// The grid with walls, obstacles and plate: obstacles in the order of the file, the plate last.
    ///
    /// # Errors
    /// If the solver refuses the domain, the numerics or an obstacle.
    pub fn solver(&self) -> Result<Solver, mpm::Error> {
        let domain = mpm::Domain {
            size: Vec2::from(self.domain.size),
            walls: self.domain.walls,
            cell: self.domain.cell,
        };
        Solver::new(domain, self.numerics, Vec2::from(self.gravity), self.rigid_boxes())
    }

    fn rigid_boxes(&self) -> Vec<mpm::Obstacle> {
        let rigid = |place: &Rectangle, faces| mpm::Obstacle {
            min: Vec2::from(place.corner),
            max: Vec2::from(place.end()),
            faces,
            velocity: Vec2::zeros(),
            start: 0.0,
        };
        let fixed = self.obstacles.iter().map(|obstacle| rigid(&obstacle.place, obstacle.faces));
        let plate = self.plate.iter().map(|plate| mpm::Obstacle {
            velocity: Vec2::from(plate.velocity),
            start: plate.start,
            ..rigid(&plate.place, plate.faces)
        });
        fixed.chain(plate).collect()
    }
}

impl From<&Elastic> for ElasticParameters {
    fn from(law: &Elastic) -> Self {
        Self { young_modulus: law.young_modulus, poisson_ratio: law.poisson_ratio }
    }
}
