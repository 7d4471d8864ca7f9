//! Rigid surroundings of an assembly: walls, boxes, a moving plate, and the floor.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::coordinates::Region;
use crate::grains::Grains;
use crate::real::Real;

/// Coulomb friction coefficients of the four sides of a box, or of a domain seen from inside.
/// Infinity stands for no sliding at all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Faces {
    /// Side of the smallest x.
    pub left: f64,
    /// Side of the largest x.
    pub right: f64,
    /// Side of the smallest y.
    pub bottom: f64,
    /// Side of the largest y.
    pub top: f64,
}

/// A rigid axis-parallel box. Sides may be at infinity, so that a wall is a box as well.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RigidBox {
    /// Lower left corner (m) until `start`.
    pub min: [f64; 2],
    /// Upper right corner (m) until `start`.
    pub max: [f64; 2],
    /// Velocity (m/s) from `start` on.
    pub velocity: [f64; 2],
    /// When it begins to move (s).
    pub start: f64,
    /// Friction of its sides.
    pub faces: Faces,
}

impl RigidBox {
    /// A box that never moves.
    pub fn fixed(min: [f64; 2], max: [f64; 2], faces: Faces) -> Self {
        Self { min, max, velocity: [0.0; 2], start: 0.0, faces }
    }

    /// How far it has moved at `time` (m).
    pub fn displacement(&self, time: f64) -> [f64; 2] {
        self.velocity.map(|v| v * (time - self.start).max(0.0))
    }

    /// Its velocity at `time` (m/s).
    pub fn velocity_at(&self, time: f64) -> [f64; 2] {
        if time < self.start { [0.0; 2] } else { self.velocity }
    }

    /// Vector from `x` to the nearest point of the box at `time` (m); zero inside.
    pub fn branch(&self, x: [f64; 2], time: f64) -> [f64; 2] {
        let moved = self.displacement(time);
        [0, 1].map(|k| x[k].clamp(self.min[k] + moved[k], self.max[k] + moved[k]) - x[k])
    }
}

/// The floor of a domain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Floor {
    /// A row of fixed grains, side by side, with their tops at the height of the floor. Grains cannot roll
    /// away on it.
    #[default]
    Rough,
    /// A flat wall with the friction of the domain's bottom.
    Flat,
}

/// The rigid surroundings of an assembly.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Boundary {
    /// Lower left corner of the domain (m).
    pub corner: [f64; 2],
    /// Width and height of the domain (m).
    pub size: [f64; 2],
    /// Friction of its four walls.
    pub walls: Faces,
    /// The kind of floor.
    pub floor: Floor,
    /// Obstacles and plates.
    pub boxes: Vec<RigidBox>,
    /// Seed of the radii of a rough floor.
    pub seed: u64,
}

impl Boundary {
    /// Upper right corner of the domain (m).
    pub(super) fn upper_corner(&self) -> [f64; 2] {
        [0, 1].map(|k| self.corner[k] + self.size[k])
    }

    /// Left, right, bottom and top wall as half planes, then the boxes. The wall below a rough floor lies
    /// one largest radius deep: whatever comes near it has leaked through the floor.
    pub(super) fn bodies(&self, grains: &Grains) -> Vec<RigidBox> {
        let [left, bottom] = self.corner;
        let [right, top] = self.upper_corner();
        let far = f64::INFINITY;
        let depth = match self.floor {
            Floor::Rough => bottom - grains.radius_max,
            Floor::Flat => bottom,
        };
        let faces = |f: f64| Faces { left: f, right: f, bottom: f, top: f };
        let wall = |min, max, friction| RigidBox::fixed(min, max, faces(friction));
        let mut bodies = vec![
            wall([-far, -far], [left, far], self.walls.left),
            wall([right, -far], [far, far], self.walls.right),
            wall([-far, -far], [far, depth], self.walls.bottom),
            wall([-far, top], [far, far], self.walls.top),
        ];
        bodies.extend(&self.boxes);
        bodies
    }

    /// Centres (m) and radii of the fixed grains of a rough floor, as far as they reach into the domain: circles
    /// that touch each other and the floor's height from below, $x_{k+1} = x_k + 2 \sqrt{r_k r_{k+1}}$ along it
    /// from $x_0 = 0$.
    pub fn floor_grains(&self, grains: &Grains) -> Vec<([f64; 2], f64)> {
        if self.floor == Floor::Flat {
            return Vec::new();
        }
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let mut radius = || rng.random_range(grains.radius_min..=grains.radius_max);
        let mut row = Vec::new();
        let (mut x, mut r) = (0.0, radius());
        while x - r < self.upper_corner()[0] {
            if x + r > self.corner[0] {
                row.push(([x, self.corner[1] - r], r));
            }
            let next = radius();
            // Tops are level and circles touch: dx² + (r - r')² = (r + r')².
            x += 2.0 * (r * next).sqrt();
            r = next;
        }
        row
    }
}

/// A box at one moment, in working precision.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body<R: Real> {
    /// Corners as fractions of the region.
    min: [R::Fraction; 2],
    max: [R::Fraction; 2],
    /// Velocity (m/s).
    pub velocity: [R; 2],
    /// Friction of the left, right, bottom and top side.
    friction: [R; 4],
}

/// Stands for infinite friction: times zero it is zero.
const NO_SLIDING: f64 = 1.0e30;

impl<R: Real> Body<R> {
    pub fn new(body: &RigidBox, region: &Region, time: f64) -> Self {
        let moved = body.displacement(time);
        let Faces { left, right, bottom, top } = body.faces;
        Self {
            min: region.encode::<R>([0, 1].map(|k| body.min[k] + moved[k])),
            max: region.encode::<R>([0, 1].map(|k| body.max[k] + moved[k])),
            velocity: body.velocity_at(time).map(R::from_f64),
            friction: [left, right, bottom, top].map(|f| R::from_f64(f.min(NO_SLIDING))),
        }
    }

    /// Vector from `s` to the nearest point of the box, in units of [`Real::UNIT`]; zero inside.
    pub fn branch(&self, s: [R::Fraction; 2]) -> [R; 2] {
        [0, 1].map(|k| {
            if s[k] < self.min[k] {
                R::nearest(s[k], self.min[k])
            } else if s[k] > self.max[k] {
                R::nearest(s[k], self.max[k])
            } else {
                R::default()
            }
        })
    }

    /// Friction of the side that a branch vector from outside ends on; at a corner, of the side that it
    /// faces more directly.
    pub fn friction(&self, branch: [R; 2]) -> R {
        let zero = R::default();
        let size = |x: R| x.max(-x);
        let [x, y] = branch;
        match (size(x) >= size(y), x > zero, y > zero) {
            (true, true, _) => self.friction[0],
            (true, false, _) => self.friction[1],
            (false, _, true) => self.friction[2],
            (false, _, false) => self.friction[3],
        }
    }
}
