//! A scene in the types of the material point method and of the DEM.

use dem::assembly::{Boundary, Faces, RigidBox};
use mpm::{ElasticParameters, Friction, Solver, Vec2, Walls};

use super::model::{Discs, Elastic, Rectangle, Scene};

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

    /// Walls, floor, obstacles and plate around discs; obstacles in the order of the file, the plate last.
    pub fn boundary(&self, discs: &Discs) -> Boundary {
        let boxes = self.rigid_boxes().into_iter().map(|o| RigidBox {
            min: o.min.into(),
            max: o.max.into(),
            velocity: o.velocity.into(),
            start: o.start,
            faces: faces(&o.faces),
        });
        Boundary {
            corner: [0.0; 2],
            size: self.domain.size,
            walls: faces(&self.domain.walls),
            floor: discs.floor,
            boxes: boxes.collect(),
            seed: self.seed,
        }
    }

    /// Obstacles in the order of the file, the plate last.
    pub(crate) fn rigid_boxes(&self) -> Vec<mpm::Obstacle> {
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

/// Coefficients of friction of the four sides.
fn faces(walls: &Walls) -> Faces {
    let coefficient = |friction| match friction {
        Friction::Slip => 0.0,
        Friction::Coulomb(coefficient) => coefficient,
        Friction::Stick => f64::INFINITY,
    };
    Faces {
        left: coefficient(walls.left),
        right: coefficient(walls.right),
        bottom: coefficient(walls.bottom),
        top: coefficient(walls.top),
    }
}

impl From<&Elastic> for ElasticParameters {
    fn from(law: &Elastic) -> Self {
        Self { young_modulus: law.young_modulus, poisson_ratio: law.poisson_ratio }
    }
}
