//! The depth of the material along x, by mass: single points on the surface hardly change it.

use std::collections::{BTreeMap, BTreeSet};

/// Width of a column of the profile over the initial distance between points. Two points fill a column, so
/// that the depth does not follow the lattice of the points.
const COLUMN: f64 = 2.0;

/// Cells of side `cell` (m) along a line of `cells` that an interval of length `size` (m) about `x` overlaps, with
/// the share of the interval in each. What lies outside counts to the cells at the ends.
pub fn overlaps(x: f64, size: f64, cell: f64, cells: usize) -> Vec<(usize, f64)> {
    let [from, to] = [(x - 0.5 * size) / cell, (x + 0.5 * size) / cell];
    let last = cells as i64 - 1;
    let share = |k: i64| {
        let inside = to.min(k as f64 + 1.0) - from.max(k as f64);
        (k.clamp(0, last) as usize, inside / (to - from))
    };
    (from.floor() as i64..to.ceil() as i64).map(share).collect()
}

/// Root mean square difference of two depth profiles (m), over the columns in which either has material.
///
/// A column has a fixed width, two `spacing` (m). Its depth is the area of the material in it over that width:
/// the heaviest of the points stands for a square of side `spacing`, the others for less by their `mass`, and the
/// squares are spread over the columns that they overlap. Columns reach over the `width` of the domain (m).
pub(super) fn profile_difference(
    a: &[[f64; 2]],
    b: &[[f64; 2]],
    mass: &[f64],
    spacing: f64,
    width: f64,
) -> f64 {
    let column = COLUMN * spacing;
    let columns = (width / column).ceil().max(1.0) as usize;
    let heaviest = mass.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    // Occupied columns only: a domain may have far more of them than points.
    let profile = |points: &[[f64; 2]]| {
        let mut depths = BTreeMap::new();
        for (&[x, _], mass) in points.iter().zip(mass) {
            let depth = mass / heaviest * spacing * spacing / column;
            for (place, share) in overlaps(x, spacing, column, columns) {
                *depths.entry(place).or_insert(0.0) += share * depth;
            }
        }
        depths
    };
    let (a, b) = (profile(a), profile(b));
    let places: BTreeSet<&usize> = a.keys().chain(b.keys()).collect();
    let depth = |of: &BTreeMap<usize, f64>, place| of.get(place).copied().unwrap_or(0.0);
    let squares = places.iter().map(|place| (depth(&a, place) - depth(&b, place)).powi(2));
    (squares.sum::<f64>() / places.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPACING: f64 = 0.0625;

    /// A block 1 m wide and 0.5 m deep whose left end is at `x` (m), in a domain 4 m wide.
    fn block(x: f64) -> Vec<[f64; 2]> {
        let middle = |k: usize| SPACING * (k as f64 + 0.5);
        (0..16 * 8).map(|k| [x + middle(k % 16), middle(k / 16)]).collect()
    }

    fn difference(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
        profile_difference(a, b, &vec![3.0; a.len()], SPACING, 4.0)
    }

    /// A block that moves by d leaves d / w of a column of width w at one end and enters one at the other: the
    /// depths of these two of nine columns change by d / w of 0.5 m. Round-off allows 1e-12 m.
    #[test]
    fn a_shift_changes_the_columns_at_the_ends() {
        let d = 0.003;
        let expected = 0.5 * d / (2.0 * SPACING) * (2.0_f64 / 9.0).sqrt();
        assert!((difference(&block(1.0 + d), &block(1.0)) - expected).abs() < 1e-12);
        assert_eq!(difference(&block(1.0), &block(1.0)), 0.0);
    }

    /// One point of 128 that is thrown 2 m high is no pile 2 m high.
    #[test]
    fn a_splash_is_no_height() {
        let mut splashed = block(1.0);
        splashed[127][1] = 2.0;
        assert_eq!(difference(&splashed, &block(1.0)), 0.0);
    }

    /// Two layers in one column are a layer deeper than one in each of two: depths of 2 s and 0 against s and s.
    #[test]
    fn a_column_that_one_leaves_empty_counts() {
        let s = SPACING;
        let pile = [[0.5 * s, 0.5 * s], [1.5 * s, 0.5 * s], [0.5 * s, 1.5 * s], [1.5 * s, 1.5 * s]];
        let layer = [0.5, 1.5, 2.5, 3.5].map(|k| [k * s, 0.5 * s]);
        assert!((difference(&pile, &layer) - s).abs() < 1e-15);
    }

    #[test]
    fn a_wide_domain_takes_no_more_memory() {
        let points = [[0.5, 2.0], [9e8 + 1.0, 1.0]];
        let difference = |b: &[[f64; 2]]| profile_difference(&points, b, &[1.0; 2], 1.0, 1e9);
        assert_eq!(difference(&points), 0.0);
        // A depth of 1/2 in one of two columns.
        assert!((difference(&points[..1]) - 0.125_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn no_share_is_lost() {
        for (x, expected) in [(0.5, vec![(0, 1.0)]), (-6.5, vec![(0, 1.0)]), (99.5, vec![(3, 1.0)])]
        {
            assert_eq!(overlaps(x, 1.0, 1.0, 4), expected);
        }
        assert_eq!(overlaps(1.25, 1.0, 1.0, 4), [(0, 0.25), (1, 0.75)]);
    }
}
