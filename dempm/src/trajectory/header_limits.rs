//! The numbers that a header may have: those of scenes.

use super::header::Header;
use crate::scene::range::{
    GRAVITY, LENGTH, Limits, MAX_CELLS, MAX_POINTS_PER_CELL, TIME, between, positive, within,
};

/// The first attribute that cannot be, and what is wrong with it.
pub(super) fn implausible(header: &Header) -> Option<(&'static str, String)> {
    let [width, height] = header.domain;
    let length = positive(LENGTH, "m");
    let numbers: [(&str, f64, Limits); 8] = [
        ("domain", width, length),
        ("domain", height, length),
        ("grid_cell", header.grid_cell, length),
        ("point_spacing", header.point_spacing, length),
        ("gravity", header.gravity[0], within(GRAVITY, "m/s²")),
        ("gravity", header.gravity[1], within(GRAVITY, "m/s²")),
        ("time_step", header.time_step, positive(TIME, "s")),
        ("frame_interval", header.frame_interval, positive(TIME, "s")),
    ];
    let wrong = |(name, number, limits): (&'static str, f64, Limits)| {
        limits.check(number).err().map(|limits| (name, format!("is {number:?}, it {limits}")))
    };
    if let Some(problem) = numbers.into_iter().find_map(wrong) {
        return Some(problem);
    }
    // A whole number but for round-off.
    let per_cell = header.grid_cell / header.point_spacing;
    if let Err(limits) = between(0.5, MAX_POINTS_PER_CELL as f64 + 0.5, "").check(per_cell) {
        let problem = format!("fits {per_cell:e} times into a `grid_cell`, which {limits}");
        return Some(("point_spacing", problem));
    }
    let cells = [width, height].map(|size| size / header.grid_cell);
    if cells.iter().any(|&n| n < 0.5) || cells[0] * cells[1] > MAX_CELLS {
        let problem = format!(
            "has {:e} x {:e} cells, at least 1 and at most {MAX_CELLS:e} in all",
            cells[0], cells[1]
        );
        return Some(("domain", problem));
    }
    let ends = header.walls.as_flattened();
    let wall = ends.iter().position(|place| !place.is_finite())?;
    Some(("boundary/walls", format!("has an end at {} m in row {}", ends[wall], wall / 4)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_absurd_number_is_named() {
        let good = Header {
            domain: [10.0, 4.0],
            gravity: [0.0, -9.81],
            grid_cell: 0.125,
            point_spacing: 0.0625,
            time_step: 1e-4,
            frame_interval: 0.01,
            ..Header::default()
        };
        assert_eq!(implausible(&good), None);
        let named = |change: &dyn Fn(&mut Header)| {
            let mut header = good.clone();
            change(&mut header);
            implausible(&header).map(|(name, _)| name)
        };
        for spacing in [0.0, 1e-300, -0.1, f64::NAN, f64::INFINITY] {
            assert_eq!(named(&|h| h.point_spacing = spacing), Some("point_spacing"), "{spacing}");
            assert!(named(&|h| h.grid_cell = spacing).is_some(), "{spacing}");
        }
        for domain in
            [[1e300, 1.0], [1e9, 1e-3], [f64::NAN, 1.0], [1.0, 0.0], [1e5, 1e5], [1.0, 1e-3]]
        {
            assert_eq!(named(&|h| h.domain = domain), Some("domain"), "{domain:?}");
        }
        for time in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(named(&|h| h.frame_interval = time), Some("frame_interval"), "{time}");
            assert_eq!(named(&|h| h.time_step = time), Some("time_step"), "{time}");
        }
        assert_eq!(named(&|h| h.gravity[1] = f64::NAN), Some("gravity"));
        assert_eq!(named(&|h| h.walls = vec![[0.0, f64::NAN, 1.0, 1.0]]), Some("boundary/walls"));
    }
}
