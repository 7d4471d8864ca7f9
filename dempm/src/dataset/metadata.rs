//! `metadata.json`: properties of a data set for learned simulators, under the keys that
//! geoelements/gns (`gns/train.py`) and LagrangeBench (`lagrangebench/case_setup`, `runner.py`)
//! read.

use std::path::Path;

use files::{WriteError, write_atomically};
use serde::Serialize;

use super::error::DatasetError;
use super::split::{DataSet, Split, open_finished};
use super::statistics::Statistics;

/// The content of `metadata.json`. Lengths in m, times in s; velocities and accelerations are
/// differences of positions per frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Metadata {
    /// Smallest and largest coordinate along each axis.
    pub bounds: [[f64; 2]; 2],
    /// Dimensions of space: 2.
    pub dim: usize,
    /// Time between frames: positions are `dt * write_every` apart.
    pub dt: f64,
    /// Steps of length `dt` between frames: 1.
    pub write_every: usize,
    /// Frames of the shortest training trajectory; `None` (null) for those of each.
    pub sequence_length: Option<usize>,
    /// Two cells of the background grid, as in the paper.
    pub default_connectivity_radius: f64,
    /// Initial distance of neighbouring points.
    pub dx: f64,
    /// Mean velocity of the training set (m/frame).
    pub vel_mean: [f64; 2],
    /// Standard deviation of the velocity (m/frame).
    pub vel_std: [f64; 2],
    /// Mean acceleration of the training set (m/frame²).
    pub acc_mean: [f64; 2],
    /// Standard deviation of the acceleration (m/frame²).
    pub acc_std: [f64; 2],
    /// Periodicity along each axis: none.
    pub periodic_boundary_conditions: [bool; 2],
    /// Points of the largest trajectory of all splits.
    pub num_particles_max: usize,
    /// Training trajectories.
    pub num_trajs_train: usize,
    /// Validation trajectories.
    pub num_trajs_valid: usize,
    /// Test trajectories.
    pub num_trajs_test: usize,
    /// Frames of the shortest training trajectory.
    pub sequence_length_train: usize,
    /// Frames of the shortest test trajectory; 0 without any.
    pub sequence_length_test: usize,
    /// The program that made the trajectories.
    pub solver: &'static str,
}

impl Metadata {
    /// Measures the training set and counts the others.
    ///
    /// # Errors
    /// If a trajectory cannot be read or is not finished, there is no training trajectory, or two of
    /// them differ in the frame interval.
    pub fn of(set: &DataSet) -> Result<Self, DatasetError> {
        let mut statistics = Statistics::default();
        let mut first = None;
        let mut lengths = Vec::new();
        for path in set.files(Split::Train) {
            let trajectory = open_finished(path)?;
            statistics.add(&trajectory)?;
            lengths.push(trajectory.frames());
            let header = trajectory.header();
            let (first_path, first) = first.get_or_insert_with(|| (path, header.clone()));
            if first.frame_interval != header.frame_interval {
                return Err(DatasetError::Differ {
                    one: first_path.clone(),
                    other: path.clone(),
                    what: "frame_interval",
                });
            }
        }
        let (_, header) = first.ok_or(DatasetError::NothingToTrain)?;
        let mut points = 0;
        let mut test_lengths = Vec::new();
        for (split, files) in &set.splits {
            for path in files {
                let trajectory = open_finished(path)?;
                points = points.max(trajectory.points().mass.len());
                if *split == Split::Test {
                    test_lengths.push(trajectory.frames());
                }
            }
        }
        let sequence_length = lengths.into_iter().min().unwrap_or(0);
        let [width, height] = header.domain;
        Ok(Self {
            bounds: [[0.0, width], [0.0, height]],
            dim: 2,
            dt: header.frame_interval,
            write_every: 1,
            sequence_length: Some(sequence_length),
            default_connectivity_radius: 2.0 * header.grid_cell,
            dx: header.point_spacing,
            vel_mean: statistics.velocity.map(|w| w.mean()),
            vel_std: statistics.velocity.map(|w| w.deviation()),
            acc_mean: statistics.acceleration.map(|w| w.mean()),
            acc_std: statistics.acceleration.map(|w| w.deviation()),
            periodic_boundary_conditions: [false; 2],
            num_particles_max: points,
            num_trajs_train: set.files(Split::Train).len(),
            num_trajs_valid: set.files(Split::Valid).len(),
            num_trajs_test: set.files(Split::Test).len(),
            sequence_length_train: sequence_length,
            sequence_length_test: test_lengths.into_iter().min().unwrap_or(0),
            solver: "DEMPM",
        })
    }

    /// Writes `metadata.json` into a folder.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        write_metadata(self, folder)
    }
}

/// Writes `metadata.json` into a folder.
///
/// # Errors
/// If it cannot be written.
pub(crate) fn write_metadata(metadata: &impl Serialize, folder: &Path) -> Result<(), WriteError> {
    let path = folder.join("metadata.json");
    write_atomically(&path, |temporary| {
        serde_json::to_string_pretty(metadata)
            .map_err(std::io::Error::other)
            .and_then(|text| std::fs::write(temporary, text + "\n"))
            .map_err(WriteError::at(&path, "write it"))
    })
}
