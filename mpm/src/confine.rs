//! Keeps points out of walls and obstacles.

use crate::budget::Ledger;
use crate::friction::{Friction, contact};
use crate::grid::Shape;
use crate::obstacle::Placed;
use crate::{Error, Points, Vec2};

/// Moves points that left the domain or entered an obstacle back onto the face, takes their
/// velocity into it away, and books count and impulse in the ledger.
///
/// The grid velocity at a point mixes nodes of the wall with free ones, so a point may creep over
/// a face. One that is more than a cell beyond is an error.
pub(crate) fn confine(
    points: &mut Points,
    shape: &Shape,
    obstacles: &[Placed],
    ledger: &mut Ledger,
) -> Result<(), Error> {
    let particles = points.position.iter_mut().zip(&mut points.velocity).zip(&points.mass);
    for (point, ((position, velocity), &mass)) in particles.enumerate() {
        let before = *position;
        if !(before.x.is_finite()
            && before.y.is_finite()
            && velocity.x.is_finite()
            && velocity.y.is_finite())
        {
            return Err(Error::NotFinite { point, position: before, velocity: *velocity });
        }
        for (obstacle, placed) in obstacles.iter().enumerate() {
            if let Some((depth, normal)) = placed.nearest_face(position) {
                if depth > shape.cell {
                    return Err(Error::InsideObstacle { point, position: before, obstacle });
                }
                *position = placed.project(*position, normal);
                let after = contact(*velocity, normal, placed.velocity, Friction::Slip);
                ledger.book_obstacle(obstacle, (after - *velocity) * mass, placed.velocity);
                *velocity = after;
            }
        }
        if !shape.contains(position) {
            for axis in 0..2 {
                let inside = position[axis].clamp(0.0, shape.size[axis]);
                let escape = inside - position[axis];
                if escape.abs() > shape.cell {
                    return Err(Error::OutsideDomain { point, position: before, size: shape.size });
                }
                if escape != 0.0 {
                    let mut normal = Vec2::zeros();
                    normal[axis] = escape.signum();
                    let after = contact(*velocity, normal, Vec2::zeros(), Friction::Slip);
                    ledger.wall_impulse += (after - *velocity) * mass;
                    *velocity = after;
                    position[axis] = inside;
                }
            }
        }
        ledger.projected += u64::from(*position != before);
    }
    Ok(())
}
