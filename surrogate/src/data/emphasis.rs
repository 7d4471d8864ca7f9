//! How often windows appear in a pass: more often where grains hit something.

use super::{DataError, DataSet, WindowShape};

/// Appearances of each window in a pass, from 1 to `most`.
///
/// A window appears as many times as the accelerations of its points scatter, in standard deviations `deviation`
/// (m/frame²) of those of the data set along x and y, rounded. Of the frames after the first `frames` of the window,
/// from each of which the network may learn, the largest scatter counts. It is zero at rest and in free fall.
///
/// # Errors
/// If a file cannot be read.
pub fn appearances(
    data: &DataSet,
    frames: usize,
    deviation: [f64; 2],
    most: usize,
) -> Result<Vec<usize>, DataError> {
    let shape = data.shape();
    let mut all = Vec::with_capacity(data.len());
    for (recording, windows) in data.recordings().iter().zip(data.windows_of_files()) {
        let positions = (0..recording.frames()).map(|frame| recording.positions(frame));
        let positions = positions.collect::<Result<Vec<_>, _>>()?;
        let scatter = scatter(&positions, shape.stride, deviation);
        all.extend((0..windows).map(|window| {
            let largest = largest_of_targets(&scatter, shape, frames, window);
            (largest.round() as usize).clamp(1, most)
        }));
    }
    Ok(all)
}

/// The largest scatter of the frames that a window is learnt from: those after its first `frames` frames.
fn largest_of_targets(scatter: &[f64], shape: WindowShape, frames: usize, window: usize) -> f64 {
    // The number of the third frame of the file, where `scatter` begins, in the windows' count.
    let third = shape.ahead() + 2 * shape.stride;
    let targets = (frames..=shape.frames).map(|k| window + k * shape.stride);
    let scatter = targets.filter_map(|target| scatter.get(target.checked_sub(third)?));
    scatter.fold(0.0, |largest, &scatter| largest.max(scatter))
}

/// Root mean square of the differences of the points' accelerations from their mean, in standard deviations, of
/// each frame from the third of `positions` (m) on.
fn scatter(positions: &[Vec<f64>], stride: usize, deviation: [f64; 2]) -> Vec<f64> {
    let later = |frames: usize| positions.iter().skip(frames * stride);
    let frames = positions.iter().zip(later(1)).zip(later(2));
    let scatter = frames.map(|((before, last), next)| {
        let accelerations = next.iter().zip(last).zip(before).map(|((n, l), b)| n - 2.0 * l + b);
        let accelerations: Vec<f64> = accelerations.collect();
        let points = accelerations.len() as f64 / 2.0;
        let mean = [0, 1].map(|k| accelerations.iter().skip(k).step_by(2).sum::<f64>() / points);
        let differences = accelerations.iter().enumerate();
        let squares = differences.map(|(k, a)| ((a - mean[k % 2]) / deviation[k % 2]).powi(2));
        (squares.sum::<f64>() / (2.0 * points)).sqrt()
    });
    scatter.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rest_and_free_fall_do_not_scatter() {
        let fall = |frame: usize| -0.01 * (frame * frame) as f64;
        let falling: Vec<Vec<f64>> =
            (0..9).map(|frame| vec![1.0, fall(frame), 3.0, 2.0 + fall(frame)]).collect();
        assert!(scatter(&falling, 1, [1e-3; 2]).iter().all(|&scatter| scatter < 1e-9));
        assert!(scatter(&falling, 2, [1e-3; 2]).iter().all(|&scatter| scatter < 1e-9));
        let resting = vec![vec![1.0, 2.0, 3.0, 4.0]; 9];
        assert!(scatter(&resting, 1, [1e-3; 2]).iter().all(|&scatter| scatter == 0.0));
    }

    /// Accelerations ±a along y about their mean and none along x: the root mean square over both axes is
    /// a / (√2 σ).
    #[test]
    fn scatter_is_in_deviations_of_the_data() {
        let frames = vec![vec![0.0, 0.0, 1.0, 0.0], vec![0.0; 4], vec![0.0, 0.3, -1.0, -0.3]];
        let [found] = scatter(&frames, 1, [1.0, 0.1])[..] else { panic!("one frame") };
        assert!((found - 0.3 / 0.1 / 2.0_f64.sqrt()).abs() < 1e-12, "{found}");
    }

    /// The windows whose targets include the frame of an impact get its scatter, also if windows begin before the
    /// file.
    #[test]
    fn windows_count_the_frames_they_are_learnt_from() {
        // Of frames 2 to 11, of which the seventh scatters.
        let scatter = [0.0, 0.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 0.0];
        for before in [0, 2] {
            // Three frames, and up to two that the network adds: targets are 3 to 5 frames after the first.
            let shape = WindowShape { frames: 5, stride: 1, before };
            for window in 0..12 + before - 5 {
                let hit = (window + 3..=window + 5).contains(&(7 + before));
                let found = largest_of_targets(&scatter, shape, 3, window);
                assert_eq!(found, if hit { 9.0 } else { 0.0 }, "window {window}");
            }
        }
    }
}
