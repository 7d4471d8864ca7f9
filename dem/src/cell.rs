//! The periodic cell: kinematics and lattice reduction.
//!
//! A deforming cell $\mathbf h = (\mathbf a, \mathbf b)$ follows any velocity gradient exactly,
//! $\mathbf h \leftarrow \exp(\mathbf L \Delta t) \mathbf h$. In simple shear it is equivalent to the sliding
//! images of Lees & Edwards (1972), J. Phys. C 5, 1921.

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

/// A periodic parallelogram; the columns of `h` are the cell vectors `a` and `b` (m).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Cell vectors as columns (m).
    pub h: Matrix2<f64>,
}

impl Cell {
    /// Square cell of side `side` (m).
    pub fn square(side: f64) -> Self {
        Self { h: Matrix2::identity() * side }
    }

    /// Area `det h` (m²).
    pub fn area(&self) -> f64 {
        self.h.determinant()
    }

    /// Distance between the two edges crossed by `a`, and between those crossed by `b` (m).
    pub fn widths(&self) -> Vector2<f64> {
        let area = self.area().abs();
        Vector2::new(area / self.h.column(1).norm(), area / self.h.column(0).norm())
    }

    /// Smaller of the two perpendicular widths (m).
    pub fn min_width(&self) -> f64 {
        self.widths().min()
    }

    /// `h⁻¹` (1/m), or `None` for a degenerate cell.
    pub fn inverse(&self) -> Option<Matrix2<f64>> {
        self.h.try_inverse().filter(|inv| inv.iter().all(|x| x.is_finite()))
    }

    /// One Gauss step of lattice reduction, if the cell vectors are more oblique than
    /// `|a.b| <= min(|a|², |b|²) / 2`: one vector loses `k` times the other.
    ///
    /// The lattice, and so every image of every grain, is unchanged.
    pub fn reduction(&self) -> Option<Reduction> {
        let a = self.h.column(0);
        let b = self.h.column(1);
        let dot = a.dot(&b);
        let (aa, bb) = (a.norm_squared(), b.norm_squared());
        // A margin keeps round-off from flipping a cell at exactly one half back and forth.
        if dot.abs() <= 0.5 * aa.min(bb) * (1.0 + 1e-9) {
            return None;
        }
        let (target, k) = if aa <= bb { (1, dot / aa) } else { (0, dot / bb) };
        Some(Reduction { target, k: k.round() as i32 })
    }

    /// Applies one reduction step to the cell vectors.
    pub fn reduce(&mut self, step: Reduction) {
        let other = self.h.column(1 - step.target).clone_owned();
        let mut target = self.h.column_mut(step.target);
        target -= other * f64::from(step.k);
    }
}

/// Vector `target` (0 = a, 1 = b) loses `k` times the other one; reduced coordinates follow by
/// `s_other += k s_target`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reduction {
    /// The vector that changes: 0 is `a`, 1 is `b`.
    pub target: usize,
    /// How many times the other vector it loses.
    pub k: i32,
}

/// `exp(A)` of a 2 x 2 matrix in closed form.
///
/// With $\mathbf A = \tfrac12 (\operatorname{tr}\mathbf A) \mathbf I + \mathbf B$ and traceless
/// $\mathbf B$, $\mathbf B^2 = -\det(\mathbf B) \mathbf I = d \mathbf I$, so
///
/// $$ \exp \mathbf A = e^{\operatorname{tr}\mathbf A / 2} \left(\cosh\sqrt d \mathbf I +
/// \frac{\sinh\sqrt d}{\sqrt d} \mathbf B\right), $$
///
/// with cosine and sine for $d < 0$.
pub fn exp(a: &Matrix2<f64>) -> Matrix2<f64> {
    let half_trace = 0.5 * a.trace();
    let b = a - Matrix2::identity() * half_trace;
    let d = -b.determinant();
    let (c, s) = if d.abs() < 1e-8 {
        (1.0 + d / 2.0 + d * d / 24.0, 1.0 + d / 6.0 + d * d / 120.0)
    } else if d > 0.0 {
        let q = d.sqrt();
        (q.cosh(), q.sinh() / q)
    } else {
        let q = (-d).sqrt();
        (q.cos(), q.sin() / q)
    };
    (Matrix2::identity() * c + b * s) * half_trace.exp()
}

/// Smallest singular value of a 2 x 2 matrix: the most a length can shrink under it.
pub fn min_stretch(f: &Matrix2<f64>) -> f64 {
    let frobenius = f.norm_squared();
    let det = f.determinant();
    let root = (frobenius * frobenius - 4.0 * det * det).max(0.0).sqrt();
    (0.5 * (frobenius - root)).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    fn matrix(range: f64) -> impl Strategy<Value = Matrix2<f64>> {
        prop::array::uniform4(-range..range).prop_map(|m| Matrix2::new(m[0], m[1], m[2], m[3]))
    }

    proptest! {
        /// det exp(A) = exp(tr A), and exp(A) exp(-A) = I.
        #[test]
        fn exponential(a in matrix(2.0)) {
            let e = exp(&a);
            prop_assert!((e.determinant() - a.trace().exp()).abs() < 1e-12 * e.norm_squared());
            prop_assert!((e * exp(&-a) - Matrix2::identity()).norm() < 1e-11 * e.norm_squared());
        }

        /// Against the power series.
        #[test]
        fn exponential_series(a in matrix(0.7)) {
            let mut sum = Matrix2::identity();
            let mut term = Matrix2::identity();
            for n in 1..30 {
                term = term * a / f64::from(n);
                sum += term;
            }
            prop_assert!((exp(&a) - sum).norm() < 1e-14);
        }

        /// Repeated reduction ends with |cos| <= 1/2 of the shorter vector and keeps the area.
        #[test]
        fn reduction_terminates(shear in -40.0..40.0f64, stretch in 0.1..10.0f64) {
            let mut cell = Cell { h: Matrix2::new(stretch, shear, 0.0, 1.0 / stretch) };
            let area = cell.area();
            let mut steps = 0;
            while let Some(r) = cell.reduction() {
                cell.reduce(r);
                steps += 1;
                prop_assert!(steps < 64);
            }
            let (a, b) = (cell.h.column(0), cell.h.column(1));
            let shorter = a.norm_squared().min(b.norm_squared());
            prop_assert!(a.dot(&b).abs() <= 0.5 * shorter * (1.0 + 1e-8));
            prop_assert!((cell.area() - area).abs() < 1e-9);
        }

        /// No vector is shortened below `min_stretch` times its length.
        #[test]
        fn shortest_stretch(f in matrix(2.0), angle in 0.0..std::f64::consts::PI) {
            let v = Vector2::new(angle.cos(), angle.sin());
            prop_assert!((f * v).norm() >= min_stretch(&f) - 1e-7);
        }
    }

    /// A rotation generator gives an exact rotation: no area drift over a full turn.
    #[test]
    fn rigid_rotation_keeps_area() {
        let spin = Matrix2::new(0.0, -10.0, 10.0, 0.0);
        let steps = 10_000;
        let increment = exp(&(spin * (2.0 * std::f64::consts::PI / 10.0 / f64::from(steps))));
        let mut cell = Cell::square(0.144);
        for _ in 0..steps {
            cell.h = increment * cell.h;
        }
        assert_relative_eq!(cell.area(), 0.144 * 0.144, max_relative = 1e-11);
        assert_relative_eq!(cell.h, Cell::square(0.144).h, epsilon = 1e-11);
    }
}
