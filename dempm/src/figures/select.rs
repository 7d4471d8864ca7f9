//! The frames to show.

use super::bodies::Bodies;
use super::error::FigureError;
use super::options::Selection;
use crate::trajectory::Trajectory;

/// The indices of the selected frames; `None` for the default selection.
pub(super) fn frames(
    bodies: &Bodies<'_>,
    selection: &Selection,
) -> Result<Option<Vec<usize>>, FigureError> {
    let (trajectory, every) = (bodies.trajectory, bodies.every());
    match selection {
        Selection::Default => Ok(None),
        Selection::Frames(names) => {
            let frames = names.iter().map(|name| frame(name, trajectory.frames(), every));
            frames.collect::<Result<_, _>>().map(Some)
        }
        Selection::Times(times) => {
            let frames = times.iter().map(|&time| nearest(time, trajectory, every));
            frames.collect::<Result<_, _>>().map(Some)
        }
    }
}

/// All frames that can be shown.
pub(super) fn all(bodies: &Bodies<'_>) -> Vec<usize> {
    (0..bodies.trajectory.frames()).step_by(bodies.every()).collect()
}

/// The frame nearest to a time (s) among every `every`-th.
fn nearest(time: f64, trajectory: &Trajectory, every: usize) -> Result<usize, FigureError> {
    if !time.is_finite() {
        return Err(FigureError::NotATime(time));
    }
    let distance = |index: &usize| (trajectory.time()[*index] - time).abs();
    let nearest =
        (0..trajectory.frames()).step_by(every).min_by(|a, b| distance(a).total_cmp(&distance(b)));
    nearest.ok_or_else(|| FigureError::Empty { path: trajectory.path().to_owned() })
}

/// A frame by its number, or `first` or `last` of every `every`-th.
fn frame(name: &str, frames: usize, every: usize) -> Result<usize, FigureError> {
    match name.trim() {
        "first" => Ok(0),
        "last" => Ok((frames - 1) / every * every),
        number => match number.parse::<usize>() {
            Ok(frame) if frame < frames && frame.is_multiple_of(every) => Ok(frame),
            Ok(frame) if frame < frames => Err(FigureError::NoGrainsAt { frame, every }),
            Ok(frame) => Err(FigureError::NoSuchFrame { frame, frames }),
            Err(_) => Err(FigureError::NotAFrame(number.to_owned())),
        },
    }
}

/// `wanted` frames spread evenly over `count`, including the first and the last.
pub(super) fn evenly(count: usize, wanted: usize) -> Vec<usize> {
    if wanted >= count {
        return (0..count).collect();
    }
    let gaps = wanted.saturating_sub(1).max(1);
    (0..wanted).map(|index| (index * (count - 1) + gaps / 2) / gaps).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn evenly_has_both_ends_and_no_doubles() {
        assert_eq!(evenly(301, 4), [0, 100, 200, 300]);
        assert_eq!(evenly(3, 4), [0, 1, 2]);
        assert_eq!(evenly(5, 4), [0, 1, 3, 4]);
        assert_eq!(evenly(9, 1), [0]);
    }

    #[test]
    fn names_of_frames() {
        assert_eq!(frame("last", 7, 1).unwrap(), 6);
        assert_eq!(frame(" 3", 7, 1).unwrap(), 3);
        assert!(frame("7", 7, 1).unwrap_err().to_string().contains("from 0 to 6"));
        assert!(frame("-1", 7, 1).unwrap_err().to_string().contains("`-1`"));
        assert_eq!(frame("last", 8, 3).unwrap(), 6);
        let error = frame("4", 8, 3).unwrap_err().to_string();
        assert!(error.contains("frame 4 has no grains: only frames 0, 3, 6, ... have"), "{error}");
    }
}
