//! Walls and rigid boxes as hard constraints: predicted positions never enter them.
//!
//! A network learns the walls of the domain with their friction, so they only stop points here.
//! Boxes are new to it and act with the friction of their faces in the scene.

use dempm::scene::{Rectangle, Scene};
use mpm::{Friction, Walls};

use crate::features::{Obstacle, friction_coefficient};

/// Largest number of passes over all boxes: a point may touch several, as in a corner.
const PASSES: usize = 4;
/// Thickness of a box's surface, as a fraction of its size.
const SKIN: f64 = 1e-9;

/// Walls and boxes that confine the points of a scene.
#[derive(Clone)]
pub struct Constraints {
    domain: [f64; 2],
    pub(crate) boxes: Vec<RigidBox>,
}

/// An obstacle or the plate.
#[derive(Clone)]
pub(crate) struct RigidBox {
    /// Position until `start`.
    pub place: Rectangle,
    pub velocity: [f64; 2],
    pub start: f64,
    pub faces: Walls,
}

impl RigidBox {
    /// Lower and upper corner at `time`.
    fn at(&self, time: f64) -> [[f64; 2]; 2] {
        let moved = (time - self.start).max(0.0);
        let shift = |corner: [f64; 2]| [0, 1].map(|k| corner[k] + self.velocity[k] * moved);
        [shift(self.place.corner), shift(self.place.end())]
    }

    fn friction(&self, axis: usize, upper: bool) -> Friction {
        match (axis, upper) {
            (0, false) => self.faces.left,
            (0, true) => self.faces.right,
            (_, false) => self.faces.bottom,
            (_, true) => self.faces.top,
        }
    }
}

impl Constraints {
    /// The walls, obstacles and plate of a scene.
    pub fn new(scene: &Scene) -> Self {
        let fixed = scene.obstacles.iter().map(|obstacle| RigidBox {
            place: obstacle.place,
            velocity: [0.0; 2],
            start: 0.0,
            faces: obstacle.faces,
        });
        let plate = scene.plate.iter().map(|plate| RigidBox {
            place: plate.place,
            velocity: plate.velocity,
            start: plate.start,
            faces: plate.faces,
        });
        Self { domain: scene.domain.size, boxes: fixed.chain(plate).collect() }
    }

    /// Size of the domain, m.
    pub fn domain(&self) -> [f64; 2] {
        self.domain
    }

    /// The boxes as networks see them in windows whose newest frame is at `time` (s), with frames
    /// `interval` (s) apart.
    pub fn obstacles(&self, time: f64, interval: f64) -> Vec<Obstacle> {
        let seen = |rigid: &RigidBox| {
            let Walls { left, right, bottom, top } = rigid.faces;
            Obstacle {
                corners: [rigid.place.corner, rigid.place.end()],
                velocity: rigid.velocity.map(|v| v * interval),
                elapsed: (time - rigid.start) / interval,
                friction: [left, right, bottom, top].map(friction_coefficient),
            }
        };
        self.boxes.iter().map(seen).collect()
    }

    /// The boxes at `time` (s) as in a trajectory: x min, y min, x max, y max (m).
    pub fn boxes(&self, time: f64) -> Vec<[f64; 4]> {
        self.boxes.iter().map(|b| b.at(time)).map(|[[a, b], [c, d]]| [a, b, c, d]).collect()
    }

    /// Moves a point (m) that went from `old` to `new` between two `times` (s) out of walls and boxes.
    pub fn confine(&self, old: [f64; 2], new: [f64; 2], times: [f64; 2]) -> [f64; 2] {
        let mut point = self.inside(new);
        for _ in 0..PASSES {
            let before = point;
            for rigid in &self.boxes {
                point = push_out(rigid, old, point, times);
            }
            point = self.inside(point);
            if point == before {
                break;
            }
        }
        point
    }

    fn inside(&self, point: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| point[k].clamp(0.0, self.domain[k]))
    }
}

/// Stops the path from `old` to `new` at the first face of the box that it crosses, and lets the
/// point slide along the face as far as friction allows.
fn push_out(rigid: &RigidBox, old: [f64; 2], new: [f64; 2], times: [f64; 2]) -> [f64; 2] {
    let [before, after] = times.map(|time| rigid.at(time));
    // In the frame of the box: where the point would have started had the box not moved.
    let shift = [0, 1].map(|k| after[0][k] - before[0][k]);
    let start = [0, 1].map(|k| old[k] + shift[k]);
    let path = [0, 1].map(|k| new[k] - start[k]);
    let Some((axis, upper)) = entry(after, start, new) else { return new };

    let along = 1 - axis;
    let mut point = new;
    point[axis] = after[usize::from(upper)][axis];
    let depth = (point[axis] - new[axis]).abs();
    let slid = match rigid.friction(axis, upper) {
        Friction::Slip => path[along],
        Friction::Coulomb(mu) => path[along].signum() * (path[along].abs() - mu * depth).max(0.0),
        Friction::Stick => 0.0,
    };
    point[along] = start[along] + slid;
    point
}

/// The face through which a path enters a box: its axis, and whether it is the upper one. `None` if
/// the path stays outside.
fn entry([low, high]: [[f64; 2]; 2], start: [f64; 2], end: [f64; 2]) -> Option<(usize, bool)> {
    let skin = [0, 1].map(|k| SKIN * (high[k] - low[k]));
    let within = |x: [f64; 2]| (0..2).all(|k| x[k] > low[k] + skin[k] && x[k] < high[k] - skin[k]);
    if within(start) {
        // The point was inside already: out through the nearest face.
        let faces = [(0, false), (0, true), (1, false), (1, true)];
        let distance = |&(axis, upper): &(usize, bool)| {
            if upper { high[axis] - end[axis] } else { end[axis] - low[axis] }
        };
        return within(end)
            .then_some(())
            .and_then(|()| faces.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b))));
    }
    // Sections of the path between the two faces of each axis.
    let (mut enters, mut leaves, mut face) = (0.0, 1.0, None);
    for axis in 0..2 {
        let step = end[axis] - start[axis];
        let (near, far) = (low[axis] + skin[axis], high[axis] - skin[axis]);
        if step == 0.0 {
            if start[axis] <= near || start[axis] >= far {
                return None;
            }
            continue;
        }
        let (first, last) = if step > 0.0 { (near, far) } else { (far, near) };
        let (first, last) = ((first - start[axis]) / step, (last - start[axis]) / step);
        if first >= enters {
            (enters, face) = (first, Some((axis, step < 0.0)));
        }
        leaves = f64::min(leaves, last);
    }
    face.filter(|_| enters < leaves)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn scene(more: &str) -> Constraints {
        let text = format!(
            "duration = 1.0\n[material]\nkind = \"mu-i\"\n[domain]\nsize = [4.0, 2.0]\n\
             [[column]]\nsize = [0.5, 0.5]\n{more}"
        );
        Constraints::new(&Scene::parse(&text, "scene.toml").unwrap())
    }

    fn barrier() -> Constraints {
        scene(
            "[[obstacle]]\ncorner = [1.0, 0.0]\nsize = [0.5, 1.0]\n\
             faces = { left = \"slip\", right = \"stick\", top = 0.5, bottom = 0.5 }\n",
        )
    }

    #[test]
    fn friction_of_each_face() {
        let barrier = barrier();
        let confine = |old, new| barrier.confine(old, new, [0.0, 0.1]);
        assert_eq!(confine([0.9, 0.5], [1.1, 0.6]), [1.0, 0.6], "smooth");
        assert_eq!(confine([1.6, 0.5], [1.4, 0.6]), [1.5, 0.5], "rough");
        let [x, y] = confine([1.2, 1.1], [1.3, 0.9]);
        assert!((x - 1.25).abs() < 1e-12 && y == 1.0, "half of the depth is lost: {x} {y}");
        assert_eq!(confine([0.5, 0.5], [0.6, 0.4]), [0.6, 0.4], "free");
        assert_eq!(confine([0.5, 0.5], [-0.1, -0.1]), [0.0, 0.0], "walls");
    }

    #[test]
    fn nothing_passes_through_in_one_frame() {
        assert_eq!(barrier().confine([0.9, 0.5], [1.9, 0.5], [0.0, 0.1]), [1.0, 0.5]);
    }

    #[test]
    fn a_plate_pushes_what_stands_still() {
        let plate = scene(
            "[plate]\ncorner = [2.0, 0.5]\nsize = [0.5, 0.5]\nvelocity = [0.0, -1.0]\n\
             start = 0.5\n",
        );
        let point = [2.2, 0.45];
        assert_eq!(plate.confine(point, point, [0.3, 0.4]), point, "not yet");
        let [x, y] = plate.confine(point, point, [0.5, 0.6]);
        assert!((x - 2.2).abs() < 1e-12 && (y - 0.4).abs() < 1e-12, "{x} {y}");
        assert_eq!(plate.boxes(0.6), [[2.0, 0.4, 2.5, 0.9]]);
    }

    proptest! {
        #[test]
        fn no_point_ends_inside(x in 0.0..4.0, y in 0.0..2.0, u in -1.0..1.0, v in -1.0..1.0) {
            let barrier = barrier();
            prop_assume!(!(x > 1.0 && x < 1.5 && y < 1.0));
            let [x, y] = barrier.confine([x, y], [x + u, y + v], [0.0, 0.01]);
            prop_assert!((0.0..=4.0).contains(&x) && (0.0..=2.0).contains(&y));
            let tight = 1e-8;
            prop_assert!(!(x > 1.0 + tight && x < 1.5 - tight && y < 1.0 - tight), "{x} {y}");
        }
    }
}
