//! The background grid.

use serde::{Deserialize, Serialize};

use crate::friction::Walls;
use crate::{Error, Vec2};

/// The box `[0, size]` with walls on its four sides and square cells.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Domain {
    /// Width and height (m); whole numbers of cells, so that walls lie on node lines.
    pub size: Vec2,
    /// Friction of each wall.
    #[serde(default)]
    pub walls: Walls,
    /// Side of a cell (m).
    pub cell: f64,
}

/// Node layers outside of the walls: what a cubic spline sees from a point on the wall.
pub(crate) const GHOSTS: usize = 2;
/// Larger grids are refused: a slip in a unit should not exhaust the memory.
const MAX_NODES: f64 = 5.0e7;

/// Numbers of cells and indexing of nodes; node `(0, 0)` is the lower left corner of the domain,
/// ghost nodes have indices below 0 or above the number of cells.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    pub cell: f64,
    pub size: Vec2,
    /// Cells along x and y.
    pub cells: [usize; 2],
    /// Nodes in a row, ghosts included.
    pub columns: usize,
    /// Rows of nodes, ghosts included.
    pub rows: usize,
}

impl Shape {
    pub fn new(domain: &Domain) -> Result<Self, Error> {
        let Domain { size, cell, .. } = *domain;
        let positive = |x: f64| x.is_finite() && x > 0.0;
        if !(positive(cell) && positive(size.x) && positive(size.y)) {
            return Err(Error::Domain(format!(
                "size ({}, {}) m and cell {cell} m must be positive",
                size.x, size.y
            )));
        }
        let count = size / cell;
        for (axis, n) in [("width", count.x), ("height", count.y)] {
            if n.round() < 1.0 || (n - n.round()).abs() > 1.0e-6 {
                return Err(Error::Domain(format!(
                    "the {axis} is {n} cells; walls must lie on node lines, so it must be a whole number"
                )));
            }
        }
        if count.x * count.y > MAX_NODES {
            return Err(Error::Domain(format!(
                "{} cells are more than {MAX_NODES}",
                count.x * count.y
            )));
        }
        let cells = [count.x.round() as usize, count.y.round() as usize];
        let [columns, rows] = cells.map(|n| n + 1 + 2 * GHOSTS);
        Ok(Self { cell, size, cells, columns, rows })
    }

    /// Position of node `(i, j)` (m).
    pub fn place(&self, i: i64, j: i64) -> Vec2 {
        Vec2::new(i as f64 * self.cell, j as f64 * self.cell)
    }

    /// Index of node `(i, j)` in row-major order.
    pub fn index(&self, i: i64, j: i64) -> usize {
        let shifted = |k: i64| (k + GHOSTS as i64) as usize;
        shifted(j) * self.columns + shifted(i)
    }

    /// The coordinate `i` or `j` of a column or row of storage.
    pub fn coordinate(&self, storage: usize) -> i64 {
        storage as i64 - GHOSTS as i64
    }

    /// Whether a position lies in the domain, walls included (false for NaN).
    pub fn contains(&self, x: &Vec2) -> bool {
        x.x >= 0.0 && x.y >= 0.0 && x.x <= self.size.x && x.y <= self.size.y
    }
}

/// A node of the background grid.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Node {
    /// Mass (kg/m).
    pub mass: f64,
    /// Momentum (kg/s), of the latest mapping.
    pub momentum: Vec2,
    /// Internal force (N/m).
    pub force: Vec2,
    /// Velocity before the step, `v_i^n` (m/s).
    pub old_velocity: Vec2,
    /// Velocity (m/s).
    pub velocity: Vec2,
    /// How fast it may approach walls and boxes in this step; zero where they do not wait for points.
    pub approach: Approach,
}

/// How fast a node may approach what it meets (m/s), so that the nearest point that it sees comes to touch.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Approach {
    /// Walls, along x and y.
    pub walls: Vec2,
    /// The box that it lies in.
    pub obstacle: f64,
}
