//! Cell averages of the volumetric strain rate, against volumetric locking.

use crate::grid::Shape;
use crate::{Mat2, Vec2};

/// Sums over the points of each cell.
#[derive(Default)]
pub(crate) struct CellAverage {
    /// `sum V_p` and `sum V_p tr L_p`.
    sums: Vec<[f64; 2]>,
}

impl CellAverage {
    /// `L_p <- L_p + (tr L_cell - tr L_p) I / 2` with `tr L_cell` the volume-weighted mean over the
    /// points in the cell: one volumetric constraint a cell instead of one a point.
    pub fn apply(
        &mut self,
        shape: &Shape,
        position: &[Vec2],
        volume: &[f64],
        gradient: &mut [Mat2],
    ) {
        let [columns, rows] = shape.cells;
        let cell = |x: &Vec2| {
            // A point on the right or upper wall belongs to the last cell.
            let along = |x: f64, n: usize| ((x / shape.cell) as usize).min(n - 1);
            along(x.y, rows) * columns + along(x.x, columns)
        };
        self.sums.clear();
        self.sums.resize(columns * rows, [0.0; 2]);
        for ((x, &v), l) in position.iter().zip(volume).zip(gradient.iter()) {
            let sum = &mut self.sums[cell(x)];
            sum[0] += v;
            sum[1] += v * l.trace();
        }
        for (x, l) in position.iter().zip(gradient) {
            let [volume, rate] = self.sums[cell(x)];
            let correction = 0.5 * (rate / volume - l.trace());
            l[(0, 0)] += correction;
            l[(1, 1)] += correction;
        }
    }
}
