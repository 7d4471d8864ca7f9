//! Which grains belong to which point: those that start in its square.

use dem::assembly::{Grain, Members};

use crate::scene::Scene;

/// Grains that start in the columns of a scene: `grains[k]` are those of column `k`, and indices count
/// through all columns.
pub(super) fn members(scene: &Scene, grains: &[Vec<Grain>]) -> Members {
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
            (first + j * squares[0] + i) as u32
        }));
        first += squares[0] * squares[1];
    }
    Members::new(first, &point_of)
}
