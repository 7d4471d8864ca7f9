//! Which frames to show.

use miette::{bail, miette};

use super::PlotArgs;
use crate::trajectory::Trajectory;

/// The frames that the arguments name, if they name any.
pub(super) fn frames(
    trajectory: &Trajectory,
    args: &PlotArgs,
) -> miette::Result<Option<Vec<usize>>> {
    let count = trajectory.frames();
    if let Some(time) = args.times.iter().find(|time| !time.is_finite()) {
        bail!("--times {time}: there is no frame at that time");
    }
    if !args.times.is_empty() {
        let nearest = |&time: &f64| {
            let distance = |index: &usize| (trajectory.time()[*index] - time).abs();
            (0..count)
                .min_by(|a, b| distance(a).total_cmp(&distance(b)))
                .ok_or_else(|| miette!("there are no frames"))
        };
        return args.times.iter().map(nearest).collect::<Result<_, _>>().map(Some);
    }
    if args.frames.is_empty() {
        return Ok(None);
    }
    args.frames.iter().map(|name| frame(name, count)).collect::<Result<_, _>>().map(Some)
}

/// A frame by its number, or `first` or `last`.
fn frame(name: &str, count: usize) -> miette::Result<usize> {
    match name.trim() {
        "first" => Ok(0),
        "last" => Ok(count - 1),
        number => match number.parse() {
            Ok(index) if index < count => Ok(index),
            Ok(index) => {
                bail!("there is no frame {index}: the file has {count}, from 0 to {}", count - 1)
            }
            Err(_) => bail!("`{number}` is not a frame: give a number, `first` or `last`"),
        },
    }
}

/// `wanted` frames spread evenly over `count`, the first and the last among them.
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
        assert_eq!(frame("last", 7).unwrap(), 6);
        assert_eq!(frame(" 3", 7).unwrap(), 3);
        assert!(frame("7", 7).unwrap_err().to_string().contains("from 0 to 6"));
        assert!(frame("-1", 7).unwrap_err().to_string().contains("`-1`"));
    }
}
