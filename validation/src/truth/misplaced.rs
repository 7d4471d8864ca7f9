//! The share of the mass that is in the wrong place.

use surrogate::evaluation::overlaps;

/// Shares of the mass in the cells of a grid from the origin, row by row from the bottom.
#[derive(Clone, Debug, PartialEq)]
pub struct Shares(Vec<f64>);

impl Shares {
    /// Spreads every mass over a square of side `spacing` (m) about its position, on a grid of cells of
    /// `cell` (m) over the `domain` (m). What lies outside counts to the cells at the edge.
    pub fn of(
        position: &[[f64; 2]],
        mass: &[f64],
        spacing: f64,
        cell: f64,
        domain: [f64; 2],
    ) -> Self {
        let [columns, rows] = domain.map(|size| (size / cell).ceil().max(1.0) as usize);
        let mut shares = vec![0.0; columns * rows];
        let total: f64 = mass.iter().sum();
        for (x, mass) in position.iter().zip(mass) {
            let [along, up] =
                [overlaps(x[0], spacing, cell, columns), overlaps(x[1], spacing, cell, rows)];
            for &(row, height) in &up {
                for &(column, width) in &along {
                    shares[row * columns + column] += mass / total * width * height;
                }
            }
        }
        Self(shares)
    }
}

/// Half of the sum of the differences between two distributions on the same grid: the share of the mass
/// that has to move to turn one into the other.
pub fn misplaced(a: &Shares, b: &Shares) -> f64 {
    0.5 * a.0.iter().zip(&b.0).map(|(a, b)| (a - b).abs()).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A block 1 m wide and 0.5 m high in a domain of 3 m x 1 m, moved by `d` (m).
    fn block(d: [f64; 2]) -> Shares {
        let at = |k: usize| [0.0625 + 0.125 * (k % 8) as f64, 0.0625 + 0.125 * (k / 8) as f64];
        let position: Vec<[f64; 2]> = (0..32).map(at).map(|[x, y]| [x + d[0], y + d[1]]).collect();
        Shares::of(&position, &[3.0; 32], 0.125, 0.0625, [3.0, 1.0])
    }

    #[test]
    fn of_a_moved_block_the_part_outside_of_its_place_is_misplaced() {
        let start = block([0.0, 0.0]);
        let moved = |d| misplaced(&start, &block(d));
        assert_eq!(moved([0.0, 0.0]), 0.0);
        assert!((moved([0.1, 0.0]) - 0.1).abs() < 1e-12);
        assert!((moved([0.0, 0.05]) - 0.1).abs() < 1e-12);
        // All of it from one width on.
        assert!((moved([1.0, 0.0]) - 1.0).abs() < 1e-12);
        assert!((moved([1.7, 0.3]) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn masses_are_relative_and_none_is_lost() {
        let one = Shares::of(&[[0.5, 0.5]], &[2.0], 0.125, 0.0625, [1.0, 1.0]);
        let heavier = Shares::of(&[[0.5, 0.5]], &[5.0], 0.125, 0.0625, [1.0, 1.0]);
        assert_eq!(misplaced(&one, &heavier), 0.0);
        let outside = Shares::of(&[[7.0, -3.0]], &[2.0], 0.125, 0.0625, [1.0, 1.0]);
        assert!((outside.0.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
