//! Particles in the form that GNS and LagrangeBench keep them: the material points, then the rigid ones.

use ndarray::{Array2, Axis};

use super::error::ExportError;
use super::rigid::RigidParticles;
use crate::scene::{Material, Scene};
use crate::trajectory::Trajectory;

/// What a particle is.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// A material point.
    Material,
    /// On a wall or a fixed box.
    Fixed,
    /// On a box that moves.
    Moving,
}

/// All particles of a trajectory.
pub(super) struct Particles {
    /// The trajectory.
    pub trajectory: Trajectory,
    /// Kind of each particle.
    pub kinds: Vec<Kind>,
    rigid: RigidParticles,
}

impl Particles {
    /// Adds particles on boxes, and on walls if `walls`, to the points of a trajectory.
    pub fn of(trajectory: Trajectory, walls: bool) -> Result<Self, ExportError> {
        let rigid = RigidParticles::of(&trajectory, walls)?;
        let material = trajectory.points().mass.iter().map(|_| Kind::Material);
        let others = rigid.moving().map(|moves| if moves { Kind::Moving } else { Kind::Fixed });
        Ok(Self { kinds: material.chain(others).collect(), trajectory, rigid })
    }

    /// The number of particles.
    pub fn count(&self) -> usize {
        self.kinds.len()
    }

    /// Positions in a frame, m: shape (particles, 2).
    pub fn positions(&self, frame: usize) -> Result<Array2<f32>, ExportError> {
        let points = self.trajectory.positions(frame..frame + 1)?;
        let boxes = self.trajectory.boxes(frame..frame + 1)?;
        let rigid = self.rigid.positions(boxes.index_axis(Axis(0), 0)).flatten();
        let all: Vec<f32> = points.iter().copied().chain(rigid).map(|x| x as f32).collect();
        Ok(Array2::from_shape_fn((self.count(), 2), |(row, axis)| all[2 * row + axis]))
    }

    /// Tangent of the friction angle: of the mu(I) law at rest, where `static_friction` is its sine, or
    /// of the contacts between grains. `None` for a material without friction.
    pub fn friction(&self) -> Option<f64> {
        // A trajectory that somebody made by hand may have no scene.
        let scene = Scene::parse(&self.trajectory.header().scene, "scene").ok()?;
        match &scene.material {
            Material::MuI(law) => Some(law.static_friction.asin().tan()),
            material => Some(material.grains()?.friction),
        }
    }
}
