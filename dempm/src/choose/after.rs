//! The error of a run from a coarser run of the same kind.

use std::path::Path;

use super::library::Distance;
use crate::comparison::{Parts, common_frames};
use crate::trajectory::{Trajectory, TrajectoryError};

/// Distance of two runs at the last common time and the largest over time; `None` if they do not start with the same
/// material or have no common time but the first.
///
/// # Errors
/// If a file cannot be read.
pub fn distance(one: &Path, other: &Path) -> Result<Option<Distance>, TrajectoryError> {
    let [one, other] = [Trajectory::open(one)?, Trajectory::open(other)?];
    let Some(parts) = Parts::of(&one, &other)? else { return Ok(None) };
    let mut found: Option<Distance> = None;
    for frames in common_frames(&[one.time(), other.time()]).iter().skip(1) {
        let &[a, b] = &frames[..] else { continue };
        let end = parts.distance(&one.frame(a)?.position, &other.frame(b)?.position);
        let largest = found.map_or(end, |before| before.largest.max(end));
        found = Some(Distance { end, largest });
    }
    Ok(found)
}
