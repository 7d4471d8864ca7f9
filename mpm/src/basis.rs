//! Basis functions of the background grid and their values at the points.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::grid::Shape;
use crate::{PARALLEL_GRAIN, Vec2};

/// Most nodes a point can see along one axis.
pub const SUPPORT: usize = 4;

/// Basis functions, as products of one-dimensional ones.
///
/// On a regular grid with ghost layers outside of the walls; splines are not modified at walls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Basis {
    /// Hat functions: discontinuous gradients, so a point that crosses a cell face kicks the grid.
    /// For comparison only.
    Linear,
    /// uGIMP: hats averaged over a point domain of constant half-size `cell / 4`.
    /// Bardenhagen & Kober (2004), CMES 5, 477.
    Gimp,
    /// Quadratic B-splines (C1). Steffen, Kirby & Berzins (2008), IJNME 76, 922.
    #[default]
    Quadratic,
    /// Cubic B-splines (C2).
    Cubic,
}

/// Half-size of a uGIMP point domain, in cells: 2 x 2 points a cell.
pub(crate) const GIMP_HALF_SIZE: f64 = 0.25;

/// One-dimensional basis functions of the nodes `first .. first + width` at a place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShapeFunctions {
    /// Lowest node.
    pub first: i64,
    /// `S_i(x)`.
    pub value: [f64; SUPPORT],
    /// `dS_i/dx` (1/cell).
    pub gradient: [f64; SUPPORT],
    /// `S_i(x) (i - x) / D` (1/cell), with `D = sum S_i (i - x)²`: weights of the affine velocity
    /// matrix of APIC.
    pub affine: [f64; SUPPORT],
}

impl Basis {
    /// Nodes a point sees along one axis.
    pub fn width(self) -> usize {
        match self {
            Self::Linear => 2,
            Self::Gimp | Self::Quadratic => 3,
            Self::Cubic => 4,
        }
    }

    /// Evaluates the basis at `x`, in cells (nodes at the integers).
    pub fn evaluate(self, x: f64) -> ShapeFunctions {
        let first = match self {
            Self::Linear => x.floor(),
            Self::Gimp => (x - GIMP_HALF_SIZE).floor(),
            Self::Quadratic => (x - 0.5).floor(),
            Self::Cubic => x.floor() - 1.0,
        };
        let mut shape = ShapeFunctions { first: first as i64, ..Default::default() };
        let u = x - first;
        match self {
            Self::Linear => {
                shape.value[..2].copy_from_slice(&[1.0 - u, u]);
                shape.gradient[..2].copy_from_slice(&[-1.0, 1.0]);
                // S (i - x) / D is the gradient for hats, and D = 0 on a node.
                shape.affine = shape.gradient;
                return shape;
            }
            Self::Gimp => {
                for k in 0..3 {
                    (shape.value[k], shape.gradient[k]) = gimp(u - k as f64);
                }
            }
            Self::Quadratic => {
                let (a, b, c) = (1.5 - u, u - 1.0, u - 0.5);
                shape.value[..3].copy_from_slice(&[0.5 * a * a, 0.75 - b * b, 0.5 * c * c]);
                shape.gradient[..3].copy_from_slice(&[-a, -2.0 * b, c]);
            }
            Self::Cubic => {
                // u in [1, 2): distance to the four nodes is u, u - 1, 2 - u, 3 - u.
                let (a, b, c, d) = (2.0 - u, u - 1.0, 2.0 - u, u - 1.0);
                shape.value = [
                    a * a * a / 6.0,
                    2.0 / 3.0 - b * b + 0.5 * b * b * b,
                    2.0 / 3.0 - c * c + 0.5 * c * c * c,
                    d * d * d / 6.0,
                ];
                shape.gradient =
                    [-0.5 * a * a, -2.0 * b + 1.5 * b * b, 2.0 * c - 1.5 * c * c, 0.5 * d * d];
            }
        }
        let moment = |k: usize| shape.value[k] * (k as f64 - u);
        let second = (0..SUPPORT).map(|k| moment(k) * (k as f64 - u)).sum::<f64>();
        shape.affine = std::array::from_fn(|k| moment(k) / second);
        shape
    }
}

/// uGIMP function and derivative at distance `d` (cells) from the node.
fn gimp(d: f64) -> (f64, f64) {
    const L: f64 = GIMP_HALF_SIZE;
    let (a, sign) = (d.abs(), d.signum());
    if a < L {
        (1.0 - (d * d + L * L) / (2.0 * L), -d / L)
    } else if a < 1.0 - L {
        (1.0 - a, -sign)
    } else if a < 1.0 + L {
        let r = 1.0 + L - a;
        (r * r / (4.0 * L), -sign * r / (2.0 * L))
    } else {
        (0.0, 0.0)
    }
}

/// Basis functions of all nodes that one point sees.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Stencil {
    /// Index of the lowest, leftmost node.
    pub node: usize,
    /// From the point to that node (m).
    pub corner: Vec2,
    /// Along x and y: values, gradients (1/m), affine weights (1/m).
    pub value: [[f64; SUPPORT]; 2],
    pub gradient: [[f64; SUPPORT]; 2],
    pub affine: [[f64; SUPPORT]; 2],
}

impl Stencil {
    fn new(basis: Basis, shape: &Shape, position: &Vec2) -> Self {
        let per_cell = 1.0 / shape.cell;
        let axes = [position.x, position.y].map(|x| basis.evaluate(x * per_cell));
        let [x, y] = axes.map(|s| s.first);
        Self {
            node: shape.index(x, y),
            corner: shape.place(x, y) - position,
            value: axes.map(|s| s.value),
            gradient: axes.map(|s| s.gradient.map(|g| g * per_cell)),
            affine: axes.map(|s| s.affine.map(|a| a * per_cell)),
        }
    }

    /// `S_ip` of the node `a` columns and `b` rows from the lowest, leftmost one.
    #[inline(always)]
    pub fn value(&self, a: usize, b: usize) -> f64 {
        self.value[0][a] * self.value[1][b]
    }

    /// `grad S_ip` (1/m).
    #[inline(always)]
    pub fn gradient(&self, a: usize, b: usize) -> Vec2 {
        Vec2::new(self.gradient[0][a] * self.value[1][b], self.value[0][a] * self.gradient[1][b])
    }

    /// `S_ip D^-1 (x_i - x_p)` (1/m).
    #[inline(always)]
    pub fn affine(&self, a: usize, b: usize) -> Vec2 {
        Vec2::new(self.affine[0][a] * self.value[1][b], self.value[0][a] * self.affine[1][b])
    }

    /// `x_i - x_p` (m).
    #[inline(always)]
    pub fn offset(&self, a: usize, b: usize, cell: f64) -> Vec2 {
        self.corner + Vec2::new(a as f64 * cell, b as f64 * cell)
    }
}

/// Evaluates the basis at every point. Positions must lie in the domain.
pub(crate) fn evaluate(
    basis: Basis,
    shape: &Shape,
    position: &[Vec2],
    stencils: &mut Vec<Stencil>,
) {
    stencils.resize(position.len(), Stencil::default());
    stencils
        .par_iter_mut()
        .zip(position)
        .with_min_len(PARALLEL_GRAIN)
        .for_each(|(stencil, x)| *stencil = Stencil::new(basis, shape, x));
}

/// Calls a function generic over the width of the basis.
macro_rules! with_width {
    ($basis:expr, $width:ident => $call:expr) => {
        match $basis.width() {
            2 => {
                const $width: usize = 2;
                $call
            }
            3 => {
                const $width: usize = 3;
                $call
            }
            _ => {
                const $width: usize = 4;
                $call
            }
        }
    };
}
pub(crate) use with_width;
