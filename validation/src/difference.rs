//! Differences between two trajectories, which may have different points and frames.

use std::path::Path;

use dempm::comparison::{Parts, common_frames};
use dempm::trajectory::{Trajectory, TrajectoryError};
use surrogate::evaluation::{Errors, Measure, mean_square_distance};

use crate::run_cache::{DIFFERENCE, Run, hash, read_json, write_json};

/// Relative tolerance on equal times.
const ROUNDING: f64 = 1e-6;

/// The [`difference`] of two files, named after the first; a failure if they do not start with the same material.
///
/// # Errors
/// If a file cannot be read.
pub fn file_difference(path: &Path, truth: &Path) -> Result<Errors, TrajectoryError> {
    let [one, truth] = [Trajectory::open(path)?, Trajectory::open(truth)?];
    let mut errors = match Parts::of(&one, &truth)? {
        Some(parts) => difference(&one, &truth, &parts)?,
        None => {
            let failure = "the two do not start with the same material".to_owned();
            Errors { failure: Some(failure), ..Errors::default() }
        }
    };
    errors.case = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(errors)
}

/// The differences of `one` from `truth` at all common times but the first, over their `parts`.
///
/// # Errors
/// If a frame cannot be read.
pub fn difference(
    one: &Trajectory,
    truth: &Trajectory,
    parts: &Parts,
) -> Result<Errors, TrajectoryError> {
    let (mass, width) = (parts.mass.clone(), truth.header().domain[0]);
    let measure = Measure { mass, spacing: parts.side, width };
    let mut errors = Errors::default();
    for (frame, place) in common_times(one.time(), truth.time()) {
        let [a, b] = parts.positions(&positions(one, frame)?, &positions(truth, place)?);
        errors.frames.push(place);
        errors.errors.push(measure.between(&a, &b, truth.time()[place]));
    }
    if one.status() != "finished" {
        errors.failure = Some(one.status().to_owned());
    }
    Ok(errors)
}

/// The [`file_difference`] of a run's trajectory, kept beside it. `key` identifies the truth.
///
/// # Errors
/// As [`file_difference`], and if it cannot be written.
pub fn kept_difference(run: &Run, truth: &Path, key: &str) -> miette::Result<Errors> {
    let file = run.output.with_file_name(format!("{DIFFERENCE}{}.json", hash(&[key])));
    if let Some(known) = read_json(&file) {
        return Ok(known);
    }
    let found = file_difference(&run.output, truth)?;
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
    let pairs = common_frames(&[one, other]).into_iter().map(|frames| (frames[0], frames[1]));
    pairs.filter(|(frame, place)| *frame > 0 && *place > 0).collect()
}

#[cfg(test)]
mod tests {
    use dempm::scene::Scene;
    use dempm::simulation::Simulation;
    use dempm::trajectory::{Frame, Header, TrajectoryWriter};

    use super::*;

    /// Two blocks of 0.5 m x 0.5 m in a box 4 m wide, in points `spacing` (m) apart, the left end of the first at `left`
    /// (m) and that of the second 0.71 m from there, which is no multiple of a spacing. All points
    /// move by 0.2 m a hundredth of a second; frames are at `times` (hundredths of a second).
    fn write(path: &Path, left: f64, spacing: f64, times: &[u32]) {
        write_laid_out("square", path, left, spacing, times);
    }

    fn write_laid_out(layout: &str, path: &Path, left: f64, spacing: f64, times: &[u32]) {
        let second = left + 0.71;
        let scene = format!(
            "duration = 0.1\nframe_interval = 0.01\n[domain]\nsize = [4.0, 1.0]\npoint_layout = \"{layout}\"\ncell = {:?}\n\
             [[column]]\ncorner = [{left:?}, 0.0]\nsize = [0.5, 0.5]\n\
             [[column]]\ncorner = [{second:?}, 0.0]\nsize = [0.5, 0.5]\n[material]\nkind = \"mu-i\"\n",
            2.0 * spacing
        );
        let simulation = Simulation::new(Scene::parse(&scene, "scene.toml").unwrap()).unwrap();
        let interval = 0.01 * f64::from(times[1] - times[0]);
        let header = Header { frame_interval: interval, ..simulation.header(String::new()) };
        let mut writer =
            TrajectoryWriter::create(path, &header, &simulation.static_points()).unwrap();
        for &k in times {
            let mut frame = Frame { time: 0.01 * f64::from(k), ..simulation.frame() };
            frame.position.iter_mut().for_each(|x| x[0] += 0.2 * f64::from(k));
            writer.push(frame).unwrap();
        }
        writer.commit().unwrap();
    }

    const ALL: [u32; 11] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10];

    /// Frames 6 and 8, 0.4 and 0.8 m on, in a box 4 m wide. Positions are kept in single precision.
    #[test]
    fn what_stays_where_it_is_falls_behind() {
        let folder = tempfile::tempdir().unwrap();
        let [truth, short] = ["truth.h5", "short.h5"].map(|name| folder.path().join(name));
        write(&truth, 0.0, 0.03125, &ALL);
        // Every second frame, and it ends at the third of its own.
        write(&short, 0.0, 0.03125, &[0, 2, 4]);
        let errors = errors_if_held(&short, &truth, 0.08).unwrap();
        assert_eq!(errors.len(), 2);
        assert!((errors[0] - 0.01).abs() < 1e-6 && (errors[1] - 0.04).abs() < 1e-6, "{errors:?}");
    }

    /// Runs of the same material, 0.04 m apart, which is no multiple of a spacing: points of the same size are
    /// compared one by one, 16 x 16 of each block; points of half the size in 8 x 8 squares of four. All are 0.04 m
    /// away, to single precision.
    #[test]
    fn every_point_counts_once() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        write(&at("truth.h5"), 0.0, 0.03125, &ALL);
        write(&at("moved.h5"), 0.04, 0.03125, &ALL);
        write(&at("coarse.h5"), 0.04, 0.0625, &ALL);
        for (name, count, side) in [("moved.h5", 512, 0.03125), ("coarse.h5", 128, 0.0625)] {
            let [one, truth] = [name, "truth.h5"].map(|name| Trajectory::open(&at(name)).unwrap());
            let parts = Parts::of(&one, &truth).unwrap().unwrap();
            assert_eq!((parts.count(), parts.side), (count, side), "{name}");
            assert_eq!(parts.are_points(), name == "moved.h5");
            let errors = difference(&one, &truth, &parts).unwrap().errors;
            assert_eq!(errors.len(), 10);
            assert!(errors.iter().all(|e| (e.distance - 0.04).abs() < 1e-6), "{errors:?}");
        }
    }

    /// Staggered points, a quarter of their spacing off, are compared on squares of two rows, which are not.
    #[test]
    fn the_layout_of_points_is_no_distance() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        write(&at("truth.h5"), 0.0, 0.03125, &ALL);
        write_laid_out("staggered", &at("moved.h5"), 0.04, 0.03125, &ALL);
        write_laid_out("staggered", &at("coarse.h5"), 0.04, 0.0625, &ALL);
        for (name, side) in [("moved.h5", 0.0625), ("coarse.h5", 0.125)] {
            let [one, truth] = [name, "truth.h5"].map(|name| Trajectory::open(&at(name)).unwrap());
            let parts = Parts::of(&one, &truth).unwrap().unwrap();
            assert_eq!(parts.side, side, "{name}");
            let errors = difference(&one, &truth, &parts).unwrap().errors;
            assert!(errors.iter().all(|e| (e.distance - 0.04).abs() < 1e-6), "{errors:?}");
        }
    }
}
