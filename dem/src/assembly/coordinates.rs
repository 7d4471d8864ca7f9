//! Positions in a bounded domain as fixed-point numbers.

use serde::{Deserialize, Serialize};

use crate::real::Real;

/// A square region in which positions are fractions of its side, see [`Real::Fraction`]: with 32 bits a
/// region of 16 m resolves 3.7 nm, a thousandth of a typical overlap. Plain f32 coordinates resolve 1 µm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Region {
    /// Lower left corner (m).
    pub origin: [f64; 2],
    /// Length of a side (m).
    pub side: f64,
}

impl Region {
    /// The smallest region that holds a rectangle and a `margin` (m) around it.
    pub fn around(min: [f64; 2], max: [f64; 2], margin: f64) -> Self {
        let side = (max[0] - min[0]).max(max[1] - min[1]) + 2.0 * margin;
        Self { origin: min.map(|x| x - margin), side }
    }

    /// Whether a position lies inside.
    pub fn contains(&self, x: [f64; 2]) -> bool {
        (0..2).all(|k| (0.0..self.side).contains(&(x[k] - self.origin[k])))
    }

    /// A position (m) as the nearest fractions; one outside of the region is moved to its edge.
    pub fn encode<R: Real>(&self, x: [f64; 2]) -> [R::Fraction; 2] {
        let largest = 1.0 - R::UNIT.max(f64::EPSILON);
        let nearest = |k: usize| (x[k] - self.origin[k]) / self.side + 0.5 * R::UNIT;
        [0, 1].map(|k| R::fraction(nearest(k).clamp(0.0, largest)))
    }

    /// Fractions as a position (m).
    pub fn decode<R: Real>(&self, s: [R::Fraction; 2]) -> [f64; 2] {
        [0, 1].map(|k| self.origin[k] + self.side * R::fraction_to_f64(s[k]))
    }

    /// Length of one unit of [`Real::Fraction`] (m).
    pub fn unit<R: Real>(&self) -> f64 {
        self.side * R::UNIT
    }
}
