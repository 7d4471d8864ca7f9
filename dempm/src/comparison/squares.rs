//! Points by the square that they start in, to compare runs with points of different sizes.

use std::collections::BTreeMap;

/// A square of side s: the integers (i, j) of [i s, (i + 1) s) x [j s, (j + 1) s).
pub type Square = [i64; 2];

/// Indices of points by the square of side `side` (m) that they start in.
pub fn by_square(start: &[[f64; 2]], side: f64) -> BTreeMap<Square, Vec<usize>> {
    let mut squares: BTreeMap<Square, Vec<usize>> = BTreeMap::new();
    for (point, x) in start.iter().enumerate() {
        // Points are inside of squares, so rounding cannot move one to the next.
        squares.entry(x.map(|x| (x / side).floor() as i64)).or_default().push(point);
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
        // Four points of spacing 1 in the square of one point of spacing 2, and one beside it.
        let start = [[0.5, 0.5], [1.5, 0.5], [0.5, 1.5], [1.5, 1.5], [2.5, 0.5]];
        let groups = by_square(&start, 2.0);
        let expected = [([0, 0], vec![0, 1, 2, 3]), ([1, 0], vec![4])];
        assert_eq!(groups, BTreeMap::from(expected));
        let moved = start.map(|[x, y]| [x + 1.0, y]);
        assert_eq!(means(&moved, groups.values()), [[2.0, 1.0], [3.5, 0.5]]);
    }
}
