//! Differences between two trajectories, which may have different points and frames.

use std::path::Path;

use dempm::trajectory::{Trajectory, TrajectoryError};
use surrogate::evaluation::{Errors, FrameError, mean_square_distance};

use crate::run_cache::{DIFFERENCE, Run, hash, read_json, write_json};
use crate::squares::{by_square, means};

/// Relative tolerance on equal times.
const ROUNDING: f64 = 1e-6;

/// The differences of `path` from `truth` at all common times but the first.
///
/// Where the points differ in size, the finer points that start in the square of a coarser one are
/// averaged, and the mean is compared with that point.
///
/// # Errors
/// If a file cannot be read.
pub fn difference(path: &Path, truth: &Path) -> Result<Errors, TrajectoryError> {
    let [one, truth] = [Trajectory::open(path)?, Trajectory::open(truth)?];
    let header = truth.header();
    let spacing = header.point_spacing.max(one.header().point_spacing);
    let squares = |file: &Trajectory| {
        Result::<_, TrajectoryError>::Ok(
            by_square(&file.frame(0)?.position, spacing).into_values().collect(),
        )
    };
    let groups: [Vec<Vec<usize>>; 2] = [squares(&one)?, squares(&truth)?];
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut errors = Errors { case: name, ..Errors::default() };
    if groups[0].len() != groups[1].len() {
        errors.failure = Some("the two do not start with the same material".to_owned());
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

/// The [`difference`] of a run's trajectory, kept beside it. `key` identifies the truth.
///
/// # Errors
/// As [`difference`], and if it cannot be written.
pub fn kept_difference(run: &Run, truth: &Path, key: &str) -> miette::Result<Errors> {
    let file = run.output.with_file_name(format!("{DIFFERENCE}{}.json", hash(&[key])));
    if let Some(known) = read_json(&file) {
        return Ok(known);
    }
    let found = difference(&run.output, truth)?;
    write_json(&file, &found)?;
    Ok(found)
}

/// Mean square distances (box width 1) of the last frame of `path` from the following frames of
/// `truth` until a time (s): the errors of a rollout that ended early, had it stayed in place.
///
/// # Errors
/// If a file cannot be read.
pub fn errors_if_held(path: &Path, truth: &Path, until: f64) -> Result<Vec<f64>, TrajectoryError> {
    let [one, truth] = [Trajectory::open(path)?, Trajectory::open(truth)?];
    let header = truth.header();
    let stride = (one.header().frame_interval / header.frame_interval).round() as usize;
    let held = positions(&one, one.frames() - 1)?;
    let next = (one.frames()..).map(|frame| frame * stride);
    let times = truth.time();
    next.take_while(|&frame| frame < times.len() && times[frame] <= until * (1.0 + ROUNDING))
        .map(|frame| {
            let distance = mean_square_distance(&held, &positions(&truth, frame)?);
            Ok(distance / header.domain[0].powi(2))
        })
        .collect()
}

fn positions(trajectory: &Trajectory, frame: usize) -> Result<Vec<[f64; 2]>, TrajectoryError> {
    let flat = trajectory.positions(frame..frame + 1)?.into_raw_vec_and_offset().0;
    Ok(flat.as_chunks().0.to_vec())
}

/// Pairs of frames at the same time, without the first frame, which is given, not computed.
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
    use dempm::scene::Scene;
    use dempm::simulation::Simulation;
    use dempm::trajectory::{Frame, Header, TrajectoryWriter};

    use super::*;

    #[test]
    fn what_stays_where_it_is_falls_behind() {
        const SCENE: &str = "duration = 0.1\nframe_interval = 0.01\n[domain]\nsize = [4.0, 1.0]\n\
                             [[column]]\nsize = [0.5, 0.5]\n[material]\nkind = \"mu-i\"\n";
        let simulation = Simulation::new(Scene::parse(SCENE, "scene.toml").unwrap()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        // All points move by 0.2 m a frame; the other run has every second frame and ends at the third of its own.
        let write = |name: &str, frames: &[u32], interval: f64| {
            let path = folder.path().join(name);
            let header = Header { frame_interval: interval, ..simulation.header(String::new()) };
            let mut writer =
                TrajectoryWriter::create(&path, &header, &simulation.static_points()).unwrap();
            for &k in frames {
                let mut frame = Frame { time: 0.01 * f64::from(k), ..simulation.frame() };
                frame.position.iter_mut().for_each(|x| x[0] += 0.2 * f64::from(k));
                writer.push(frame).unwrap();
            }
            writer.commit().unwrap();
            path
        };
        let truth = write("truth.h5", &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10], 0.01);
        let short = write("short.h5", &[0, 2, 4], 0.02);
        let errors = errors_if_held(&short, &truth, 0.08).unwrap();
        // Frames 6 and 8, 0.4 and 0.8 m on, in a box 4 m wide. Positions are kept in single precision.
        assert_eq!(errors.len(), 2);
        assert!((errors[0] - 0.01).abs() < 1e-6 && (errors[1] - 0.04).abs() < 1e-6, "{errors:?}");
    }

    #[test]
    fn frames_are_matched_by_time() {
        let fine = [0.0, 0.1, 0.2, 0.30000000001, 0.4];
        assert_eq!(common_times(&fine, &[0.0, 0.2, 0.4, 0.6]), [(2, 1), (4, 2)]);
        assert_eq!(common_times(&[0.0, 0.3], &fine), [(1, 3)]);
        assert_eq!(common_times(&[0.0, 0.25], &fine), []);
    }
}
