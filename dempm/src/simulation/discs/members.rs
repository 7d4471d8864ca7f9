//! Which grains belong to which point.

use dem::assembly::Grain;
use serde::{Deserialize, Serialize};

use crate::scene::Scene;

/// The grains of every point: those that start in its square.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Members {
    /// Grains of point `p`: `grain[start[p]..start[p + 1]]`.
    start: Vec<u32>,
    /// Indices of grains, point by point.
    grain: Vec<u32>,
}

impl Members {
    /// Grains that start in the columns of a scene: `grains[k]` are those of column `k`, and indices count
    /// through all columns.
    pub fn new(scene: &Scene, grains: &[Vec<Grain>]) -> Self {
        let spacing = scene.domain.spacing();
        let mut first = 0;
        let mut point_of = Vec::new();
        for (column, grains) in scene.columns.iter().zip(grains) {
            let squares = column.place.size.map(|size| (size / spacing).round() as usize);
            point_of.extend(grains.iter().map(|grain| {
                // A grain pressed against the side of its column may lie on the edge.
                let [i, j] = [0, 1].map(|k| {
                    let along = ((grain.x[k] - column.place.corner[k]) / spacing) as usize;
                    along.min(squares[k] - 1)
                });
                first + j * squares[0] + i
            }));
            first += squares[0] * squares[1];
        }
        let mut start = vec![0; first + 1];
        for &point in &point_of {
            start[point + 1] += 1;
        }
        for k in 1..start.len() {
            start[k] += start[k - 1];
        }
        let mut next = start.clone();
        let mut grain = vec![0; point_of.len()];
        for (index, &point) in point_of.iter().enumerate() {
            grain[next[point] as usize] = index as u32;
            next[point] += 1;
        }
        Self { start, grain }
    }

    /// Indices of the grains of a point.
    pub fn of(&self, point: usize) -> &[u32] {
        &self.grain[self.start[point] as usize..self.start[point + 1] as usize]
    }

    /// The point of every grain.
    pub fn points(&self) -> Vec<u32> {
        let mut points = vec![0; self.grain.len()];
        for (point, bounds) in self.start.windows(2).enumerate() {
            for &grain in &self.grain[bounds[0] as usize..bounds[1] as usize] {
                points[grain as usize] = point as u32;
            }
        }
        points
    }

    /// The first point without grains.
    pub fn first_empty(&self) -> Option<usize> {
        self.start.windows(2).position(|bounds| bounds[0] == bounds[1])
    }
}
