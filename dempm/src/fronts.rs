//! The front of a pile that a few points in flight do not move.

/// Share of the mass behind the [`mass_front`].
pub const MASS_SHARE: f64 = 0.99;

/// The least x (m) of a point with 99 % of the mass at or behind it; NaN without points. Points without a
/// finite position do not count.
pub fn mass_front(position: &[[f64; 2]], mass: &[f64]) -> f64 {
    let finite = position.iter().zip(mass).filter(|(x, _)| x[0].is_finite());
    let mut points: Vec<(f64, f64)> = finite.map(|(x, m)| (x[0], *m)).collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Round-off of the sum must not move the front by a point.
    let wanted = MASS_SHARE * (1.0 - 1e-12) * points.iter().map(|(_, m)| m).sum::<f64>();
    let mut behind = 0.0;
    let front = points.iter().find(|(_, m)| {
        behind += m;
        behind >= wanted
    });
    front.map_or(f64::NAN, |(x, _)| *x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 20 x 10 points one spacing of 0.1 m apart.
    fn pile() -> Vec<[f64; 2]> {
        let place = |k: usize| [0.05 + 0.1 * (k % 20) as f64, 0.05 + 0.1 * (k / 20) as f64];
        (0..200).map(place).collect()
    }

    #[test]
    fn the_mass_front_leaves_one_per_cent_ahead() {
        let mut position = pile();
        assert_eq!(mass_front(&position, &[2.0; 200]), position[19][0]);
        // Two of 200 points are 1 %: the front does not move with them, but with a third.
        position[0][0] = 7.0;
        position[1][0] = 8.0;
        assert_eq!(mass_front(&position, &[2.0; 200]), position[19][0]);
        position[2][0] = 9.0;
        assert_eq!(mass_front(&position, &[2.0; 200]), 7.0);
        // Mass counts, not points: x = k with mass k holds n (n + 1) / 2 up to n.
        let line: Vec<[f64; 2]> = (1..=100).map(|k| [f64::from(k), 0.0]).collect();
        let mass: Vec<f64> = (1..=100).map(f64::from).collect();
        assert_eq!(mass_front(&line, &mass), 100.0);
        assert_eq!(mass_front(&line, &mass.iter().rev().copied().collect::<Vec<_>>()), 91.0);
        assert!(mass_front(&[[f64::NAN; 2]], &[1.0]).is_nan());
    }
}
