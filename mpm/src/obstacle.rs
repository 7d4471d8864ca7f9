//! Rigid boxes in the domain: fixed barriers and moving plates.

use serde::{Deserialize, Serialize};

use crate::friction::{Friction, Walls, contact};
use crate::grid::Shape;
use crate::{Error, Vec2};

/// A rigid box, at rest or with a prescribed velocity (barrier, piston, gate).
///
/// Nodes on or in the box obey the contact condition of the nearest face. At equal distance from
/// two adjacent faces (the box's diagonals, and so its corners) the velocity may not point into
/// the box, i.e. not approach both faces; if it does, the smaller approach is removed, which is the
/// nearest velocity that a convex corner admits: material slides over the top edge or down the
/// side, whichever it does already. At equal distance from two opposite faces (the middle of a
/// box) both act.
///
/// A face that lies on a node line acts exactly there. Elsewhere the grid feels it at the next
/// node line inside, and points are kept out one by one. A box should be two cells thick at
/// least: points on both sides of a thinner one share nodes. Faces on or behind a wall of the
/// domain do not act, so a box may stand on the floor. Boxes should not touch each other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Obstacle {
    /// Lower left corner (m) until `start`.
    pub min: Vec2,
    /// Upper right corner (m) until `start`.
    pub max: Vec2,
    /// Friction of the faces.
    #[serde(default)]
    pub faces: Walls,
    /// Velocity (m/s) from `start` on; zero is a fixed barrier.
    #[serde(default = "Vec2::zeros")]
    pub velocity: Vec2,
    /// When the box begins to move (s).
    #[serde(default)]
    pub start: f64,
}

impl Obstacle {
    pub(crate) fn check(&self, obstacle: usize) -> Result<(), Error> {
        let error = |reason: String| Err(Error::Obstacle { obstacle, reason });
        let finite = |v: &Vec2| v.iter().all(|x| x.is_finite());
        if !(finite(&self.min)
            && finite(&self.max)
            && finite(&self.velocity)
            && self.start.is_finite())
        {
            return error("all numbers must be finite".into());
        }
        if !(self.min.x < self.max.x && self.min.y < self.max.y) {
            return error("min must be less than max along both axes".into());
        }
        self.faces.sides().iter().try_for_each(|f| f.check()).or_else(error)
    }

    /// The box at time `t` (s).
    pub fn at(&self, t: f64) -> Self {
        let shift = self.shift(t);
        Self { min: self.min + shift, max: self.max + shift, ..*self }
    }

    fn shift(&self, t: f64) -> Vec2 {
        self.velocity * (t - self.start).max(0.0)
    }
}

const LEFT: usize = 0;
const RIGHT: usize = 1;
const BOTTOM: usize = 2;
const TOP: usize = 3;

/// A box as it stands and moves in one step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    min: Vec2,
    max: Vec2,
    friction: [Friction; 4],
    /// Mean velocity over the step (m/s).
    pub velocity: Vec2,
}

impl Placed {
    /// The box at time `t`, with its mean velocity from there to `t + dt`. Sides on or behind a
    /// wall are moved to infinity, where they do not act.
    pub fn new(obstacle: &Obstacle, shape: &Shape, t: f64, dt: f64) -> Self {
        let Obstacle { mut min, mut max, faces, .. } = obstacle.at(t);
        let tolerance = tolerance(shape.cell);
        for axis in 0..2 {
            if min[axis] <= tolerance {
                min[axis] = f64::NEG_INFINITY;
            }
            if max[axis] >= shape.size[axis] - tolerance {
                max[axis] = f64::INFINITY;
            }
        }
        let velocity = (obstacle.shift(t + dt) - obstacle.shift(t)) / dt;
        Self { min, max, friction: faces.sides(), velocity }
    }

    /// Whether the node at `x` lies on or in the box.
    pub fn holds(&self, x: &Vec2, cell: f64) -> bool {
        self.depths(x).iter().all(|&d| d >= -tolerance(cell))
    }

    /// The distance (m) of a point outside.
    pub fn distance(&self, x: &Vec2) -> f64 {
        let [left, right, bottom, top] = self.depths(x);
        Vec2::new(left.min(right).min(0.0), bottom.min(top).min(0.0)).norm()
    }

    /// Velocity of the node at `x` after contact with the box, which it may `approach` (m/s).
    pub fn contact(&self, x: &Vec2, velocity: Vec2, cell: f64, approach: f64) -> Vec2 {
        if !self.holds(x, cell) {
            return velocity;
        }
        let tolerance = tolerance(cell);
        let depth = self.depths(x);
        let nearest = depth.iter().copied().fold(f64::INFINITY, f64::min);
        let acts = depth.map(|d| d <= nearest + tolerance);
        let sides = acts.iter().filter(|&&a| a).count();
        let across = [LEFT, RIGHT].iter().find(|&&s| acts[s]);
        let along = [BOTTOM, TOP].iter().find(|&&s| acts[s]);
        if let (2, Some(&a), Some(&b)) = (sides, across, along) {
            return self.corner_contact(velocity, a, b, approach);
        }
        let sides = (0..4).filter(|&side| acts[side]);
        sides.fold(velocity, |v, side| self.side_contact(v, side, approach))
    }

    fn side_contact(&self, velocity: Vec2, side: usize, approach: f64) -> Vec2 {
        let surface = self.velocity - normal(side) * approach;
        contact(velocity, normal(side), surface, self.friction[side])
    }

    fn corner_contact(&self, velocity: Vec2, a: usize, b: usize, approach: f64) -> Vec2 {
        let relative = velocity - self.velocity;
        let [approach_a, approach_b] = [a, b].map(|side| -relative.dot(&normal(side)));
        if approach_a < approach || approach_b < approach {
            return velocity;
        }
        self.side_contact(velocity, if approach_a < approach_b { a } else { b }, approach)
    }

    /// The nearest face of a point strictly inside the box: its depth (m) and outward normal.
    pub fn nearest_face(&self, x: &Vec2) -> Option<(f64, Vec2)> {
        let depth = self.depths(x);
        if depth.iter().any(|&d| d <= 0.0) {
            return None;
        }
        (0..4).map(|side| (depth[side], normal(side))).min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// The point moved onto the face of this `normal`.
    pub fn project(&self, mut x: Vec2, normal: Vec2) -> Vec2 {
        let axis = usize::from(normal.y != 0.0);
        x[axis] = if normal[axis] < 0.0 { self.min[axis] } else { self.max[axis] };
        x
    }

    /// Depth of `x` below the left, right, bottom and top face (m).
    fn depths(&self, x: &Vec2) -> [f64; 4] {
        let (a, b) = (x - self.min, self.max - x);
        [a.x, b.x, a.y, b.y]
    }
}

/// Round-off allowed in "on a face" (m).
fn tolerance(cell: f64) -> f64 {
    1.0e-9 * cell
}

/// Outward normal of a side.
fn normal(side: usize) -> Vec2 {
    match side {
        LEFT => -Vec2::x(),
        RIGHT => Vec2::x(),
        BOTTOM => -Vec2::y(),
        _ => Vec2::y(),
    }
}
