//! The surfaces of boxes near a point, fixed ones and moving ones.

use super::obstacle::Obstacle;

/// Columns of the nearest fixed surface, and of the nearest moving one.
const FIXED: usize = 4;
const MOVING: usize = 6;
/// Columns of both.
pub const SURFACE_COLUMNS: usize = FIXED + MOVING;
/// Those of them that are velocities.
pub const SURFACE_VELOCITY: [usize; 2] = [FIXED + 3, FIXED + 4];

/// The nearest surface of a fixed box and the nearest one of a moving box, of each point: closeness
/// c = 1 - distance / radius, and c times the outward normal, the velocity (m/frame; of a moving box
/// only) and the friction coefficient of the face. All are 0 beyond the radius, where c vanishes, so
/// that nothing jumps when a box comes into reach. Inside a box the distance is negative and c at most 2.
///
/// `positions` (m) are points x 2, in the frame `back` frames before the newest one of the window.
/// Returns points x [`SURFACE_COLUMNS`].
pub fn surfaces(positions: &[f32], obstacles: &[Obstacle], back: usize, radius: f32) -> Vec<f32> {
    let points = positions.as_chunks::<2>().0;
    let mut columns = Vec::with_capacity(points.len() * SURFACE_COLUMNS);
    for &point in points {
        let nearest = |fixed: bool| {
            let kind = obstacles.iter().filter(|obstacle| obstacle.is_fixed() == fixed);
            let contacts = kind.map(|o| (Contact::new(o.corners_at(back), point), o));
            let near = contacts.filter(|(contact, _)| contact.distance <= radius);
            near.min_by(|(a, _), (b, _)| a.distance.total_cmp(&b.distance))
        };
        let closeness = |contact: &Contact| (1.0 - contact.distance / radius).min(2.0);
        match nearest(true) {
            Some((contact, obstacle)) => {
                let (c, [x, y]) = (closeness(&contact), contact.normal);
                columns.extend([c, c * x, c * y, c * obstacle.friction[contact.face]]);
            }
            None => columns.extend([0.0; FIXED]),
        }
        match nearest(false) {
            Some((contact, obstacle)) => {
                let (c, [x, y]) = (closeness(&contact), contact.normal);
                let [u, v] = obstacle.velocity_at(back);
                let friction = obstacle.friction[contact.face];
                columns.extend([c, c * x, c * y, c * u, c * v, c * friction]);
            }
            None => columns.extend([0.0; MOVING]),
        }
    }
    columns
}

/// How a point lies to a box.
struct Contact {
    /// Distance to the surface, m; negative inside.
    distance: f32,
    /// Outward normal there.
    normal: [f32; 2],
    /// The face, in the order of [`Obstacle::friction`].
    face: usize,
}

impl Contact {
    fn new([low, high]: [[f32; 2]; 2], point: [f32; 2]) -> Self {
        let offset = [0, 1].map(|k| point[k] - point[k].max(low[k]).min(high[k]));
        let square = offset[0] * offset[0] + offset[1] * offset[1];
        if square > 0.0 {
            let distance = square.sqrt();
            let axis = usize::from(offset[1].abs() >= offset[0].abs());
            let face = 2 * axis + usize::from(offset[axis] > 0.0);
            return Self { distance, normal: offset.map(|o| o / distance), face };
        }
        let depths = [point[0] - low[0], high[0] - point[0], point[1] - low[1], high[1] - point[1]];
        let mut face = 0;
        for other in 1..4 {
            if depths[other] < depths[face] {
                face = other;
            }
        }
        let mut normal = [0.0; 2];
        normal[face / 2] = if face % 2 == 0 { -1.0 } else { 1.0 };
        Self { distance: -depths[face], normal, face }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS: f32 = 0.5;

    /// A fixed box from (1, 0) to (2, 1) and a plate above it that comes down.
    fn boxes() -> [Obstacle; 2] {
        let friction = [0.0, 0.25, 0.5, 1.0];
        let plate = Obstacle {
            corners: [[1.0, 3.0], [2.0, 4.0]],
            velocity: [0.0, -0.25],
            elapsed: 4.0,
            friction: [0.5; 4],
        };
        [Obstacle { friction, ..Obstacle::fixed([[1.0, 0.0], [2.0, 1.0]]) }, plate]
    }

    fn seen(point: [f32; 2], back: usize) -> Vec<f32> {
        surfaces(&point, &boxes(), back, RADIUS)
    }

    #[test]
    fn distance_normal_and_friction_of_a_face() {
        let none = [0.0; MOVING];
        // A quarter to the left of the box, to the right, and above.
        assert_eq!(seen([0.75, 0.5], 4), [&[0.5, -0.5, 0.0, 0.0][..], &none].concat());
        assert_eq!(seen([2.25, 0.5], 4), [&[0.5, 0.5, 0.0, 0.125][..], &none].concat());
        assert_eq!(seen([1.5, 1.25], 4), [&[0.5, 0.0, 0.5, 0.5][..], &none].concat());
        // On the surface and inside.
        assert_eq!(seen([1.5, 1.0], 4)[..4], [1.0, 0.0, 1.0, 1.0]);
        assert_eq!(seen([1.5, 0.875], 4)[..4], [1.25, 0.0, 1.25, 1.25]);
        // Out of reach.
        assert_eq!(seen([0.4, 0.5], 4), [0.0; SURFACE_COLUMNS]);
        // Beyond a corner, (0.3, 0.4) from it: the radius, where all vanishes.
        let corner = surfaces(&[2.15, 1.2], &boxes()[..1], 0, RADIUS);
        for (found, expected) in corner.iter().zip([0.5, 0.3, 0.4, 0.5]) {
            assert!((found - expected).abs() < 1e-6, "{corner:?}");
        }
    }

    #[test]
    fn a_moving_surface_comes_with_its_velocity() {
        // The plate has moved by one: its lower face is at 2, a quarter above the point.
        let plate = [0.5, 0.0, -0.5, 0.0, -0.125, 0.25];
        assert_eq!(seen([1.5, 1.75], 0), [&[0.0; FIXED][..], &plate].concat());
        // Before it moved it was out of reach.
        assert_eq!(seen([1.5, 1.75], 4), [0.0; SURFACE_COLUMNS]);
    }

    #[test]
    fn mirror_images_see_mirrored_normals() {
        let image = boxes().map(|obstacle| obstacle.mirrored(4.0));
        for point in [[0.75, 0.5], [2.25, 0.5], [2.2, 1.3], [1.25, 1.75]] {
            let straight = surfaces(&point, &boxes(), 0, RADIUS);
            let mut back = surfaces(&[4.0 - point[0], point[1]], &image, 0, RADIUS);
            for column in [1, FIXED + 1, FIXED + 3] {
                back[column] = -back[column];
            }
            for (a, b) in straight.iter().zip(back) {
                assert!((a - b).abs() < 1e-6, "{point:?}");
            }
        }
    }
}
