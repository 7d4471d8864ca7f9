//! Walls and boxes that kinematic particles stand for.

use ndarray::{Array3, ArrayView3};

/// Particles belong to the same body up to this distance, in spacings.
const GAP: f64 = 1.5;
/// Particles up to this distance from the bounds are part of a wall, in spacings.
const WALL: f64 = 0.6;
/// Motion that is none, in spacings.
const STILL: f64 = 1e-3;
/// Largest change of a body's shape, in spacings.
const BENT: f64 = 0.1;

/// Rectangles along the axes.
pub(super) struct Bodies {
    boxes: Vec<Body>,
}

/// A rectangle over time.
pub(super) struct Body {
    /// At the first frame: x min, y min, x max, y max, m.
    pub place: [f64; 4],
    /// Displacement since the first frame, m, one a frame; none for a body at rest.
    pub path: Vec<[f64; 2]>,
}

impl Bodies {
    /// Finds the bodies of `rigid` particles (frames x particles x 2, m) in a domain from the origin to
    /// `domain` (m). Fixed particles along the bounds are walls. `material` is where nothing may be.
    ///
    /// # Errors
    /// If a body bends, turns or is no rectangle.
    pub fn find(
        rigid: &Array3<f64>,
        material: &Array3<f64>,
        domain: [f64; 2],
        spacing: f64,
    ) -> Result<Self, String> {
        let (frames, count, _) = rigid.dim();
        let shift = |particle: usize, frame: usize| {
            [0, 1].map(|k| rigid[[frame, particle, k]] - rigid[[0, particle, k]])
        };
        let moves = |particle: usize| {
            (0..frames)
                .any(|frame| shift(particle, frame).iter().any(|x| x.abs() > STILL * spacing))
        };
        let on_wall = |particle: usize| {
            (0..2).any(|k| {
                let x = rigid[[0, particle, k]];
                x < WALL * spacing || x > domain[k] - WALL * spacing
            })
        };
        let (moving, fixed): (Vec<usize>, Vec<usize>) = (0..count).partition(|&p| moves(p));
        let fixed: Vec<usize> = fixed.into_iter().filter(|&p| !on_wall(p)).collect();
        let mut boxes = Vec::new();
        for group in groups(rigid.view(), &fixed, GAP * spacing) {
            let place = to_walls(bounding_box(rigid.view(), &group, spacing), domain, spacing);
            boxes.push(Body { place, path: Vec::new() });
        }
        for group in groups(rigid.view(), &moving, GAP * spacing) {
            let path: Vec<[f64; 2]> = (0..frames).map(|frame| shift(group[0], frame)).collect();
            let bent = |&particle: &usize| {
                let change = |frame: usize, k: usize| shift(particle, frame)[k] - path[frame][k];
                (0..frames).any(|frame| (0..2).any(|k| change(frame, k).abs() > BENT * spacing))
            };
            if group.iter().any(bent) {
                return Err(format!(
                    "a body of {} kinematic particles turns or bends",
                    group.len()
                ));
            }
            boxes.push(Body { place: bounding_box(rigid.view(), &group, spacing), path });
        }
        let bodies = Self { boxes };
        match bodies.first_inside(material, spacing) {
            Some(particle) => Err(format!(
                "particle {particle} of the material is inside the rectangle around kinematic ones"
            )),
            None => Ok(bodies),
        }
    }

    /// The rectangles.
    pub fn boxes(&self) -> &[Body] {
        &self.boxes
    }

    /// The first particle of the material that is deep inside a box at the first frame.
    fn first_inside(&self, material: &Array3<f64>, spacing: f64) -> Option<usize> {
        let inside = |x: [f64; 2]| {
            self.boxes.iter().any(|body| {
                let place = body.place;
                (0..2).all(|k| x[k] > place[k] + spacing && x[k] < place[k + 2] - spacing)
            })
        };
        (0..material.dim().1).find(|&p| inside([material[[0, p, 0]], material[[0, p, 1]]]))
    }
}

impl Body {
    /// The rectangle at a frame, m.
    pub fn at(&self, frame: usize) -> [f64; 4] {
        let [x, y] = self.path.get(frame).copied().unwrap_or_default();
        let [left, bottom, right, top] = self.place;
        [left + x, bottom + y, right + x, top + y]
    }
}

/// Particles that are connected by steps of at most `reach` (m) at the first frame.
fn groups(positions: ArrayView3<f64>, particles: &[usize], reach: f64) -> Vec<Vec<usize>> {
    let near = |a: usize, b: usize| {
        let [x, y] = [0, 1].map(|k| positions[[0, a, k]] - positions[[0, b, k]]);
        x.hypot(y) <= reach
    };
    let mut left = particles.to_vec();
    let mut groups = Vec::new();
    while let Some(first) = left.pop() {
        let mut group = vec![first];
        let mut next = 0;
        while next < group.len() {
            let (found, rest) = left.iter().partition(|&&other| near(group[next], other));
            group.extend::<Vec<usize>>(found);
            left = rest;
            next += 1;
        }
        groups.push(group);
    }
    groups
}

/// The rectangle around particles at the first frame, at least a spacing wide and high.
fn bounding_box(positions: ArrayView3<f64>, group: &[usize], spacing: f64) -> [f64; 4] {
    let [[left, right], [bottom, top]] = [0, 1].map(|k| {
        let values = || group.iter().map(|&particle| positions[[0, particle, k]]);
        let low = values().fold(f64::INFINITY, f64::min);
        let high = values().fold(f64::NEG_INFINITY, f64::max);
        let margin = 0.5 * (spacing - (high - low)).max(0.0);
        [low - margin, high + margin]
    });
    [left, bottom, right, top]
}

/// Extends a rectangle to the bounds that it nearly reaches: particles on both are part of the wall.
fn to_walls(place: [f64; 4], domain: [f64; 2], spacing: f64) -> [f64; 4] {
    let near = (WALL + 1.0) * spacing;
    let low = |x: f64| if x < near { 0.0 } else { x };
    let high = |x: f64, end: f64| if x > end - near { end } else { x };
    let [left, bottom, right, top] = place;
    [low(left), low(bottom), high(right, domain[0]), high(top, domain[1])]
}
