//! Fronts of a pile that a few points in flight do not move.

use std::collections::HashMap;

/// Share of the mass behind the [`mass_front`].
pub const MASS_SHARE: f64 = 0.99;
/// Distance over which points are connected, in spacings.
pub const REACH: f64 = 1.5;

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

/// The largest x (m) in the largest cluster of points; NaN without points. Points closer than 1.5 `spacing`
/// (m) belong to one cluster; of two that are equal the one with the lower index counts.
pub fn pile_front(position: &[[f64; 2]], spacing: f64) -> f64 {
    let reach = REACH * spacing;
    let bin = |x: [f64; 2]| x.map(|x| (x / reach).floor() as i64);
    let is_finite = |x: &[f64; 2]| x.iter().all(|x| x.is_finite());
    let mut bins: HashMap<[i64; 2], Vec<usize>> = HashMap::new();
    for (point, &x) in position.iter().enumerate().filter(|(_, x)| is_finite(x)) {
        bins.entry(bin(x)).or_default().push(point);
    }
    let mut seen: Vec<bool> = position.iter().map(|x| !is_finite(x)).collect();
    let (mut largest, mut front) = (0, f64::NAN);
    for start in 0..position.len() {
        if std::mem::replace(&mut seen[start], true) {
            continue;
        }
        let (mut size, mut most, mut open) = (0, f64::MIN, vec![start]);
        while let Some(point) = open.pop() {
            let x = position[point];
            (size, most) = (size + 1, most.max(x[0]));
            let [i, j] = bin(x);
            for other in (-1..=1).flat_map(|b| (-1..=1).map(move |a| [i + a, j + b])) {
                for &near in bins.get(&other).into_iter().flatten() {
                    let distance = (position[near][0] - x[0]).hypot(position[near][1] - x[1]);
                    if !seen[near] && distance < reach {
                        seen[near] = true;
                        open.push(near);
                    }
                }
            }
        }
        if size > largest {
            (largest, front) = (size, most);
        }
    }
    front
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

    #[test]
    fn the_pile_ends_where_its_points_are_apart() {
        let mut position = pile();
        let end = position[19][0];
        assert_eq!(pile_front(&position, 0.1), end);
        // A bridge of points 1.4 spacings apart belongs to the pile, one beyond 1.6 does not.
        position.extend([[end + 0.14, 0.05], [end + 0.28, 0.05]]);
        assert_eq!(pile_front(&position, 0.1), end + 0.28);
        position.extend((0..50).map(|k| [end + 0.44 + 0.1 * f64::from(k), 0.05]));
        assert_eq!(pile_front(&position, 0.1), end + 0.28);
        position.push([f64::NAN, 0.0]);
        position.push([f64::INFINITY, 0.0]);
        assert_eq!(pile_front(&position, 0.1), end + 0.28);
        assert!(pile_front(&[], 0.1).is_nan());
    }
}
