//! Means of a quantity over the cells of the grid.

use std::collections::HashMap;

/// At each point the mean over the points of its grid cell, by mass. Values that are not finite do not count; a cell
/// without others has none. Stresses of single points scatter with their packings and their places in the cell.
pub(super) fn over_cells(
    values: &[f64],
    position: &[[f64; 2]],
    mass: &[f64],
    cell: f64,
) -> Vec<f64> {
    let place = |x: &[f64; 2]| x.map(|x| (x / cell).floor() as i64);
    let mut sums: HashMap<[i64; 2], [f64; 2]> = HashMap::new();
    for ((value, x), mass) in values.iter().zip(position).zip(mass) {
        if value.is_finite() {
            let [sum, total] = sums.entry(place(x)).or_default();
            *sum += mass * value;
            *total += mass;
        }
    }
    let mean = |x: &[f64; 2]| sums.get(&place(x)).map_or(f64::NAN, |[sum, total]| sum / total);
    position.iter().map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_cell_share_their_mean() {
        let position = [[0.1, 0.1], [0.9, 0.9], [1.1, 0.1], [1.2, 0.3], [-0.5, 0.5]];
        let values = [1.0, 5.0, 7.0, f64::NAN, f64::INFINITY];
        let means = over_cells(&values, &position, &[3.0, 1.0, 1.0, 1.0, 1.0], 1.0);
        // (3 x 1 + 1 x 5) / 4 in the first cell.
        assert_eq!(means[..4], [2.0, 2.0, 7.0, 7.0]);
        assert!(means[4].is_nan());
    }
}
