//! Values of the basis functions at the points.

use rayon::prelude::*;

use crate::basis::{Basis, SUPPORT};
use crate::grid::Shape;
use crate::{PARALLEL_GRAIN, Vec2};

/// Basis functions at one point, of all nodes in its support.
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
        let axes = [0, 1].map(|axis| basis.evaluate(position[axis] * per_cell));
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
