//! How many grid cells points cross from one frame to the next.

use std::path::PathBuf;

use dempm::trajectory::Trajectory;

/// Intervals between frames of the paper's five data sets, in frames of the first.
const STRIDES: [usize; 5] = [1, 2, 3, 6, 10];

/// Numbers of points and frames by the cells they cross: one histogram for each data set.
///
/// # Errors
/// If a trajectory cannot be read.
pub fn histograms(paths: &[PathBuf]) -> miette::Result<Vec<Vec<usize>>> {
    let mut counts = STRIDES.map(|_| Vec::<usize>::new());
    for path in paths {
        let trajectory = Trajectory::open(path)?;
        let (cell, frames) = (trajectory.header().grid_cell, trajectory.frames());
        let position = trajectory.positions(0..frames)?;
        for (count, stride) in counts.iter_mut().zip(STRIDES) {
            for frame in (stride..frames).step_by(stride) {
                for point in 0..trajectory.points().mass.len() {
                    let at = |frame: usize| [0, 1].map(|k| position[[frame, point, k]]);
                    let crossed = crossed(at(frame - stride), at(frame), cell);
                    if count.len() <= crossed {
                        count.resize(crossed + 1, 0);
                    }
                    count[crossed] += 1;
                }
            }
        }
    }
    Ok(counts.into())
}

/// Number of cell faces between two positions, summed over both axes.
fn crossed(from: [f64; 2], to: [f64; 2], cell: f64) -> usize {
    let along = |k: usize| ((to[k] / cell).floor() - (from[k] / cell).floor()).abs() as usize;
    along(0) + along(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_are_counted_along_both_axes() {
        assert_eq!(crossed([0.1, 0.1], [0.2, 0.1], 0.25), 0);
        assert_eq!(crossed([0.1, 0.6], [0.6, 0.4], 0.25), 3);
    }
}
