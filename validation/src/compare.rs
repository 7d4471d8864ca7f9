//! How far one trajectory is from another, also where they differ in points and frames.

use std::collections::BTreeMap;
use std::path::Path;

use dempm::trajectory::{Trajectory, TrajectoryError};
use surrogate::metrics::{Errors, FrameError};

use crate::work::{Run, hash, read_json, write_json};

/// Relative difference of times that is rounding.
const ROUNDING: f64 = 1e-6;

/// The differences of `path` from `truth` at all times that both have, but the first.
///
/// Where the two have points of different sizes, points are averaged over the squares of the
/// coarser one at the start: means of the finer points that began in a coarse point's square are
/// compared with that point.
///
/// # Errors
/// If a file cannot be read.
pub fn difference(path: &Path, truth: &Path) -> Result<Errors, TrajectoryError> {
    let [one, truth] = [Trajectory::open(path)?, Trajectory::open(truth)?];
    let header = truth.header();
    let spacing = header.point_spacing.max(one.header().point_spacing);
    let groups =
        [groups(&one.frame(0)?.position, spacing), groups(&truth.frame(0)?.position, spacing)];
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut errors = Errors { case: name, ..Errors::default() };
    if groups[0].len() != groups[1].len() {
        errors.failure = Some("the two do not begin with the same material".to_owned());
        return Ok(errors);
    }
    for (frame, place) in common_times(one.time(), truth.time()) {
        let a = means(&positions(&one, frame)?, &groups[0]);
        let b = means(&positions(&truth, place)?, &groups[1]);
        let time = truth.time()[place];
        errors.frames.push(place);
        errors.errors.push(FrameError::between(&a, &b, time, header.domain[0], spacing));
    }
    if one.status() != "finished" {
        errors.failure = Some(one.status().to_owned());
    }
    Ok(errors)
}

/// The same for the result of a run, kept beside it. `key` stands for the truth.
///
/// # Errors
/// As [`difference`], and if it cannot be kept.
pub fn kept_difference(run: &Run, truth: &Path, key: &str) -> miette::Result<Errors> {
    let file = run.output.with_file_name(format!("difference-{}.json", hash(&[key])));
    if let Some(known) = read_json(&file) {
        return Ok(known);
    }
    let found = difference(&run.output, truth)?;
    write_json(&file, &found)?;
    Ok(found)
}

fn positions(trajectory: &Trajectory, frame: usize) -> Result<Vec<[f64; 2]>, TrajectoryError> {
    let flat = trajectory.positions(frame..frame + 1)?.into_raw_vec_and_offset().0;
    Ok(flat.as_chunks().0.to_vec())
}

/// Points by the square of side `spacing` that they begin in, from the lower left corner.
fn groups(start: &[[f64; 2]], spacing: f64) -> Vec<Vec<usize>> {
    let mut squares: BTreeMap<[i64; 2], Vec<usize>> = BTreeMap::new();
    for (point, x) in start.iter().enumerate() {
        // Points are in the middle of squares, so rounding cannot move one to the next.
        squares.entry(x.map(|x| (x / spacing).floor() as i64)).or_default().push(point);
    }
    squares.into_values().collect()
}

fn means(position: &[[f64; 2]], groups: &[Vec<usize>]) -> Vec<[f64; 2]> {
    let mean = |group: &Vec<usize>| {
        let sum = |k: usize| group.iter().map(|&point| position[point][k]).sum::<f64>();
        [sum(0) / group.len() as f64, sum(1) / group.len() as f64]
    };
    groups.iter().map(mean).collect()
}

/// Frames of the two at the same time, the first left out: it is given, not computed.
pub fn common_times(one: &[f64], other: &[f64]) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    let mut place = 1;
    for (frame, time) in one.iter().enumerate().skip(1) {
        let same = |other: f64| (other - time).abs() <= ROUNDING * time.abs();
        while place < other.len() && other[place] < *time && !same(other[place]) {
            place += 1;
        }
        if place < other.len() && same(other[place]) {
            pairs.push((frame, place));
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finer_points_are_averaged_over_the_square_of_a_coarser_one() {
        // Four points of spacing 1 in the square of one point of spacing 2, and one beside it.
        let start = [[0.5, 0.5], [1.5, 0.5], [0.5, 1.5], [1.5, 1.5], [2.5, 0.5]];
        let groups = groups(&start, 2.0);
        assert_eq!(groups, [vec![0, 1, 2, 3], vec![4]]);
        let moved = start.map(|[x, y]| [x + 1.0, y]);
        assert_eq!(means(&moved, &groups), [[2.0, 1.0], [3.5, 0.5]]);
    }

    #[test]
    fn frames_are_matched_by_time() {
        let fine = [0.0, 0.1, 0.2, 0.30000000001, 0.4];
        assert_eq!(common_times(&fine, &[0.0, 0.2, 0.4, 0.6]), [(2, 1), (4, 2)]);
        assert_eq!(common_times(&[0.0, 0.3], &fine), [(1, 3)]);
        assert_eq!(common_times(&[0.0, 0.25], &fine), []);
    }
}
