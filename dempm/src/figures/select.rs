//! The frames to show.

use super::error::FigureError;
use super::options::Selection;
use super::shown::Shown;

/// The places of the selected frames among the common ones; `None` for the default selection.
pub(super) fn places(
    shown: &Shown<'_>,
    selection: &Selection,
) -> Result<Option<Vec<usize>>, FigureError> {
    match selection {
        Selection::Default => Ok(None),
        Selection::Frames(names) => {
            let first = &shown.runs[0].bodies;
            let frames: Vec<usize> = shown.frames.iter().map(|frames| frames[0]).collect();
            let (count, every) = (first.trajectory.frames(), first.every());
            let places = names.iter().map(|name| place(name, &frames, count, every));
            places.collect::<Result<_, _>>().map(Some)
        }
        Selection::Times(times) => {
            let all: Vec<f64> = (0..shown.frames.len()).map(|place| shown.time(place)).collect();
            times.iter().map(|&time| nearest(time, &all)).collect::<Result<_, _>>().map(Some)
        }
    }
}

/// The place of the time nearest to `time` (s), which lies between the first and the last or less than an interval
/// outside.
fn nearest(time: f64, all: &[f64]) -> Result<usize, FigureError> {
    if !time.is_finite() {
        return Err(FigureError::NotATime(time));
    }
    let distance = |place: &usize| (all[*place] - time).abs();
    let nearest = (0..all.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let (nearest, &[first, .., last]) = (nearest.ok_or(FigureError::NoCommonTime)?, all) else {
        return Ok(0);
    };
    let interval = (last - first) / (all.len() - 1) as f64;
    if time < first - interval || time > last + interval {
        return Err(FigureError::OutsideOfTime { time, first, last });
    }
    Ok(nearest)
}

/// The place of a frame by its number, or `first` or `last`, among `frames`: those of `count` that can be shown, which
/// have grains if they are an `every`-th.
fn place(name: &str, frames: &[usize], count: usize, every: usize) -> Result<usize, FigureError> {
    match name.trim() {
        "first" => Ok(0),
        "last" => Ok(frames.len() - 1),
        number => {
            let frame: usize =
                number.parse().map_err(|_| FigureError::NotAFrame(number.to_owned()))?;
            frames.iter().position(|shown| *shown == frame).ok_or(if frame >= count {
                FigureError::NoSuchFrame { frame, frames: count }
            } else if frame.is_multiple_of(every) {
                FigureError::NotCommon(frame)
            } else {
                FigureError::NoGrainsAt { frame, every }
            })
        }
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
        let all = [0, 1, 2, 3, 4, 5, 6];
        assert_eq!(place("last", &all, 7, 1).unwrap(), 6);
        assert_eq!(place(" 3", &all, 7, 1).unwrap(), 3);
        let error = |name: &str, frames: &[usize], count, every| {
            place(name, frames, count, every).unwrap_err().to_string()
        };
        assert!(error("7", &all, 7, 1).contains("from 0 to 6"));
        assert!(error("-1", &all, 7, 1).contains("`-1`"));
        assert_eq!(place("last", &[0, 3, 6], 8, 3).unwrap(), 2);
        let grains = error("4", &[0, 3, 6], 8, 3);
        assert!(
            grains.contains("frame 4 has no grains: only frames 0, 3, 6, ... have"),
            "{grains}"
        );
        assert!(error("1", &[0, 2], 4, 1).contains("no frame at the time of frame 1"));
    }

    #[test]
    fn times_pick_the_nearest_frame() {
        assert_eq!(nearest(0.26, &[0.0, 0.1, 0.3]).unwrap(), 2);
        assert_eq!(nearest(0.31, &[0.0, 0.1, 0.3]).unwrap(), 2);
        assert!(
            nearest(9.0, &[0.0, 0.1, 0.3]).unwrap_err().to_string().contains("from 0 to 0.3 s")
        );
        assert!(nearest(f64::NAN, &[0.0]).unwrap_err().to_string().contains("not a time"));
    }
}
