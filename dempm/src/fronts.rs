//! Fronts of a pile that a few points in flight do not move.

use rayon::prelude::*;

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

/// Solid depth of a layer (mean grain diameters) at which [`connected_front`] ends a pile. Grains side by side are
/// pi / 4 deep.
pub const CONNECTED_DEPTH: f64 = 0.5;

/// The foremost x (m) that a layer of at least `depth` (m) of solid connects to the pile; NaN without parts.
/// `parts` are the x (m) of grains or points and the area (m²) of solid in them; those without area do not count.
///
/// Between two parts that are neighbours in x, the layer is as deep as the mean of their areas over their
/// distance. Where it is shallower than `depth` the material falls apart, and the largest piece is the pile. The
/// definition is the same for single grains and for points, which only resolve it less.
pub fn connected_front(parts: &[(f64, f64)], depth: f64) -> f64 {
    let strips = strips(parts, depth);
    let connected = |a: &Strip, b: &Strip| {
        let ((x_a, area_a), (x_b, area_b)) = (a.last, b.first);
        0.5 * (area_a + area_b) >= depth * (x_b - x_a)
    };
    let pieces = strips.chunk_by(connected).filter_map(|piece| {
        let area: f64 = piece.iter().map(|strip| strip.area).sum();
        Some((area, piece.last()?.last.0))
    });
    pieces.max_by(|a, b| a.0.total_cmp(&b.0)).map_or(f64::NAN, |(_, front)| front)
}

/// Parts so near to one another that a layer connects them whatever their areas.
#[derive(Clone, Copy)]
struct Strip {
    /// x (m) and area (m²) of the first and the last part.
    first: (f64, f64),
    last: (f64, f64),
    /// Area of all parts (m²).
    area: f64,
}

impl Strip {
    fn of(part: (f64, f64)) -> Self {
        Self { first: part, last: part, area: part.1 }
    }

    /// Adds the parts of another strip at the same place.
    fn join(strip: &mut Option<Self>, other: Self) {
        let Some(strip) = strip else {
            *strip = Some(other);
            return;
        };
        strip.area += other.area;
        if other.first.0 < strip.first.0 {
            strip.first = other.first;
        }
        if other.last.0 > strip.last.0 {
            strip.last = other.last;
        }
    }
}

/// Parts that are sorted into strips at a time.
const CHUNK: usize = 65_536;

/// The parts in strips as wide as a layer of `depth` with the least of their areas, from left to right. So the
/// grains of a scene need not be sorted in every frame. If that makes more strips than there are parts, because one is
/// tiny or far away, each part is a strip. The same for any number of threads.
fn strips(parts: &[(f64, f64)], depth: f64) -> Vec<Strip> {
    let bounds = parts.par_chunks(CHUNK).map(Bounds::of).reduce(Bounds::default, Bounds::join);
    let width = bounds.area / depth;
    let number = |x: f64| ((x - bounds.begin) / width) as usize;
    if number(bounds.end) >= parts.len() {
        let mut counted: Vec<_> = parts.iter().copied().filter(counts).collect();
        counted.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        return counted.into_iter().map(Strip::of).collect();
    }
    let of_chunk = |chunk: &[(f64, f64)]| {
        let mut strips: Vec<Option<Strip>> = vec![None; number(bounds.end) + 1];
        for part in chunk.iter().filter(|part| counts(part)) {
            Strip::join(&mut strips[number(part.0)], Strip::of(*part));
        }
        strips
    };
    let chunks: Vec<_> = parts.par_chunks(CHUNK).map(of_chunk).collect();
    let joined = chunks.into_iter().reduce(|mut left, right| {
        for (strip, other) in left.iter_mut().zip(right) {
            if let Some(other) = other {
                Strip::join(strip, other);
            }
        }
        left
    });
    joined.unwrap_or_default().into_iter().flatten().collect()
}

/// Whether a part has a place and an area.
fn counts((x, area): &(f64, f64)) -> bool {
    x.is_finite() && *area > 0.0
}

/// Where parts lie (m), and their least area (m²).
#[derive(Clone, Copy)]
struct Bounds {
    begin: f64,
    end: f64,
    area: f64,
}

impl Default for Bounds {
    /// Of no parts.
    fn default() -> Self {
        Self { begin: f64::INFINITY, end: f64::NEG_INFINITY, area: f64::INFINITY }
    }
}

impl Bounds {
    fn of(parts: &[(f64, f64)]) -> Self {
        let counted = parts.iter().filter(|part| counts(part));
        let each = counted.map(|&(x, area)| Self { begin: x, end: x, area });
        each.fold(Self::default(), Self::join)
    }

    fn join(self, other: Self) -> Self {
        Self {
            begin: self.begin.min(other.begin),
            end: self.end.max(other.end),
            area: self.area.min(other.area),
        }
    }
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

    /// Grains of 10 mm side by side, at x = 0 to 0.99 m.
    fn row() -> Vec<(f64, f64)> {
        (0..100).map(|k| (0.01 * f64::from(k), 0.25 * std::f64::consts::PI * 1e-4)).collect()
    }

    #[test]
    fn the_connected_front_is_the_last_grain_of_a_layer() {
        let depth = CONNECTED_DEPTH * 0.01;
        let front = |parts: &[(f64, f64)]| connected_front(parts, depth);
        let mut parts = row();
        let area = parts[0].1;
        assert_eq!(front(&parts), 0.99);
        // A gap between centres of pi / 2 diameters is half a diameter deep.
        parts.push((0.99 + 0.0157, area));
        assert_eq!(front(&parts), 0.99 + 0.0157);
        parts.push((0.99 + 0.0157 + 0.0158, area));
        assert_eq!(front(&parts), 0.99 + 0.0157);
        // A larger piece elsewhere is the pile, whatever the order of parts.
        parts.extend(row().iter().map(|&(x, area)| (x - 3.0, 2.0 * area)));
        assert!((front(&parts) + 2.01).abs() < 1e-12);
        assert!(front(&[]).is_nan() && front(&[(f64::NAN, 1.0)]).is_nan());
    }

    /// Points of 50 mm x 50 mm with a solid fraction of 0.8 stand for a layer of 10 mm as far as 0.2 m apart.
    #[test]
    fn points_of_a_thin_layer_are_connected() {
        let layer = |spacing: f64| -> Vec<(f64, f64)> {
            (0..10).map(|k| (spacing * f64::from(k), 0.8 * 0.05 * 0.05)).collect()
        };
        assert!((connected_front(&layer(0.199), 0.01) - 9.0 * 0.199).abs() < 1e-12);
        // As far apart as that they are pieces of the same size.
        let alone = connected_front(&[layer(0.201), vec![(0.05, 0.002)]].concat(), 0.01);
        assert!((alone - 0.201).abs() < 1e-12, "{alone}");
    }

    /// The definition, with all parts in order.
    fn front_of_sorted(mut parts: Vec<(f64, f64)>, depth: f64) -> f64 {
        parts.sort_by(|a, b| a.0.total_cmp(&b.0));
        let pieces = parts.chunk_by(|a, b| 0.5 * (a.1 + b.1) >= depth * (b.0 - a.0));
        let areas = pieces.map(|piece| (piece.iter().map(|part| part.1).sum::<f64>(), piece));
        let (_, pile) = areas.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        pile.last().unwrap().0
    }

    #[test]
    fn strips_find_the_front_of_sorted_parts() {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        // Also of more parts than are sorted at a time, in a domain that is as much wider.
        for count in std::iter::repeat_n(200, 200).chain([150_000]) {
            // Mean gaps of 0.005 m; parts of mean area are connected up to 0.01 m to 0.04 m.
            let half = 0.0025 * f64::from(count);
            let parts: Vec<(f64, f64)> = (0..count)
                .map(|_| (rng.random_range(-half..half), rng.random_range(1.0..3.0)))
                .collect();
            let depth = 2.0 / rng.random_range(0.01..0.04);
            let front = connected_front(&parts, depth);
            assert_eq!(front, front_of_sorted(parts, depth));
        }
    }

    /// One dust grain or one far away makes no strips without number, of which the memory would be terabytes.
    #[test]
    fn tiny_and_far_parts_leave_the_front_as_it_is() {
        let depth = CONNECTED_DEPTH * 0.01;
        for odd in [(0.505, 1e-15), (1e9, 1e-4)] {
            assert_eq!(connected_front(&[row(), vec![odd]].concat(), depth), 0.99);
        }
    }
}
