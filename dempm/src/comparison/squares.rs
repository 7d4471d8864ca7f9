//! Points by the square of material that they start in, to compare runs with points of different sizes.

use std::collections::BTreeMap;

use crate::scene::{PointLayout, Scene};
use crate::trajectory::{Header, Trajectory, TrajectoryError};

/// A square of side s: the column, and the integers (i, j) of [i s, (i + 1) s) x [j s, (j + 1) s) from its lower left
/// corner.
pub type Square = [i64; 3];

/// Where a point starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Index of its column.
    pub column: u32,
    /// Its place from the lower left corner of the column, m.
    pub place: [f64; 2],
}

/// Where the points of a run start: on the lattices of the columns of its scene. Of a run whose points are not those of
/// its scene, as an imported one, the positions in its first frame, as of one column.
///
/// # Errors
/// If that frame cannot be read.
pub fn starts(file: &Trajectory) -> Result<Vec<Start>, TrajectoryError> {
    let header = file.header();
    if let Ok(scene) = Scene::parse(&header.scene, "scene")
        && scene.point_count() == file.points().mass.len()
    {
        let points = scene.points();
        let start = |(position, &column): (&[f64; 2], &u32)| {
            let corner = scene.columns[column as usize].place.corner;
            Start { column, place: [position[0] - corner[0], position[1] - corner[1]] }
        };
        return Ok(points.position.iter().zip(&points.column).map(start).collect());
    }
    let first = if file.frames() > 0 { file.frame(0)?.position } else { Vec::new() };
    let half = 0.5 * header.point_spacing;
    let end = [0, 1].map(|k| first.iter().map(|x| x[k]).fold(f64::INFINITY, f64::min) - half);
    let start = |x: &[f64; 2]| Start { column: 0, place: [x[0] - end[0], x[1] - end[1]] };
    Ok(first.iter().map(start).collect())
}

/// Least side (m) of squares in whose middle their points are centred at the start: that of a point, or of two rows of
/// them if rows are staggered.
pub fn least_side(header: &Header) -> f64 {
    let staggered = Scene::parse(&header.scene, "scene")
        .is_ok_and(|scene| scene.domain.point_layout == PointLayout::Staggered);
    if staggered { 2.0 * header.point_spacing } else { header.point_spacing }
}

/// Indices of points by the square of side `side` (m) that they start in.
pub fn by_square(starts: &[Start], side: f64) -> BTreeMap<Square, Vec<usize>> {
    let mut squares: BTreeMap<Square, Vec<usize>> = BTreeMap::new();
    for (point, start) in starts.iter().enumerate() {
        // Points are inside of squares, so rounding cannot move one to the next.
        let [i, j] = start.place.map(|x| (x / side).floor() as i64);
        squares.entry([i64::from(start.column), i, j]).or_default().push(point);
    }
    squares
}

/// Mean position (m) of each group of points; points have equal masses.
pub fn means<'a>(
    position: &[[f64; 2]],
    groups: impl IntoIterator<Item = &'a Vec<usize>>,
) -> Vec<[f64; 2]> {
    let mean = |group: &Vec<usize>| {
        [0, 1].map(|k| {
            group.iter().map(|&point| position[point][k]).sum::<f64>() / group.len() as f64
        })
    };
    groups.into_iter().map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finer_points_are_averaged_over_the_square_of_a_coarser_one() {
        // Four points of spacing 1 in the square of one point of spacing 2, one beside it and one in another column.
        let start = [[0.5, 0.5], [1.5, 0.5], [0.5, 1.5], [1.5, 1.5], [2.5, 0.5], [0.5, 0.5]];
        let column = [0, 0, 0, 0, 0, 1];
        let starts = [0, 1, 2, 3, 4, 5].map(|k| Start { column: column[k], place: start[k] });
        let groups = by_square(&starts, 2.0);
        let expected = [([0, 0, 0], vec![0, 1, 2, 3]), ([0, 1, 0], vec![4]), ([1, 0, 0], vec![5])];
        assert_eq!(groups, BTreeMap::from(expected));
        let moved = start.map(|[x, y]| [x + 1.0, y]);
        assert_eq!(means(&moved, groups.values()), [[2.0, 1.0], [3.5, 0.5], [1.5, 0.5]]);
    }
}
