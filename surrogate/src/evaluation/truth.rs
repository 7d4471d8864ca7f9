//! Predictions against the mean of several seeds of the truth.
//!
//! Runs of one scene that differ in their seeds are apart by chaos. Their mean is the best prediction there is; a
//! single seed misses it by the spread. Means leave out the seed that is compared with them, or that the prediction
//! starts from, so that both distances hold the same share of chance.

use std::path::{Path, PathBuf};

use dempm::comparison::{Parts, common_frames};
use dempm::trajectory::Trajectory;
use serde::Serialize;

use super::error::EvaluationError;
use super::metrics::mean_square_distance;
use super::seeds::Seeds;
use crate::rollout::{InitialFrames, Rollout, stride};
use crate::simulator::Simulator;

/// Distances below this part of the distance between points do not count: they are no difference.
const NOTHING: f64 = 0.1;

/// Distances from the truth at one time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TruthRow {
    /// Time, s.
    pub time: f64,
    /// Root mean square distance of one seed from the mean of the others, m.
    pub spread: f64,
    /// The same of the prediction; `None` after it failed.
    pub distance: Option<f64>,
    /// The same of other runs, in the order in which they were given; `None` where one has no frame.
    pub others: Vec<Option<f64>>,
}

/// A scene against its truth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AgainstTruth {
    /// Name of the scene.
    pub scene: String,
    /// Its class.
    pub class: String,
    /// Number of seeds.
    pub seeds: usize,
    /// Initial distance between points, m.
    pub spacing: f64,
    /// The frames that are predicted.
    pub rows: Vec<TruthRow>,
    /// The error that ended a prediction early.
    pub failure: Option<String>,
}

impl AgainstTruth {
    /// A distance over the spread, or over a tenth of the distance between points where that is larger.
    pub fn ratio(&self, distance: f64, spread: f64) -> f64 {
        distance / spread.max(NOTHING * self.spacing)
    }

    /// The largest ratio of the prediction over time; infinite if it failed.
    pub fn worst(&self) -> f64 {
        self.largest(|row| row.distance)
    }

    /// The largest ratio of the `other`-th of the other runs; `None` without one.
    pub fn worst_of(&self, other: usize) -> Option<f64> {
        let has = self.rows.iter().any(|row| row.others[other].is_some());
        has.then(|| self.largest(|row| row.others[other]))
    }

    fn largest(&self, of: impl Fn(&TruthRow) -> Option<f64>) -> f64 {
        let ratio = |row: &TruthRow| of(row).map_or(f64::INFINITY, |d| self.ratio(d, row.spread));
        self.rows.iter().map(ratio).fold(0.0, f64::max)
    }

    /// The row at a time (s), or the last before it; `None` if all are later.
    pub fn at(&self, time: f64) -> Option<&TruthRow> {
        self.rows.iter().rev().find(|row| row.time <= time + 1e-6)
    }
}

/// Checks that other runs of a scene, where they exist, start with its material.
///
/// # Errors
/// If one does not, or cannot be read.
pub fn check_others(seeds: &Seeds, others: &[PathBuf]) -> Result<(), EvaluationError> {
    let mut existing = others.iter().filter(|path| path.exists());
    existing.try_for_each(|path| common_parts(path, &seeds.files[0]).map(|_| ()))
}

/// Compares rollouts from each seed of a scene, and other runs of it, with the mean of the other seeds. `None` of
/// a single seed.
///
/// # Errors
/// If a trajectory cannot be read, the model cannot start from it, or runs are of different scenes.
pub fn against_truth(
    simulator: &Simulator,
    seeds: &Seeds,
    others: &[PathBuf],
) -> Result<Option<AgainstTruth>, EvaluationError> {
    if seeds.files.len() < 2 {
        return Ok(None);
    }
    let runs: Vec<Run> =
        seeds.files.iter().map(|path| Run::read(path, simulator)).collect::<Result<_, _>>()?;
    let [first, rest @ ..] = &runs[..] else { return Ok(None) };
    for other in rest {
        if other.frames[0].len() != first.frames[0].len() {
            let [path, other] = [0, 1].map(|k| seeds.files[k].clone());
            return Err(EvaluationError::OtherPoints { path, other });
        }
    }
    let start = simulator.first_frames();
    let count = runs.iter().map(|run| run.frames.len()).min().unwrap_or(0);
    let mut squares = vec![0.0; count];
    let mut predicted = vec![Some(0.0); count];
    let mut failure = None;
    let without: Vec<Vec<Vec<[f64; 2]>>> = (0..runs.len())
        .map(|left_out| (0..count).map(|frame| mean_without(&runs, left_out, frame)).collect())
        .collect();
    let share = 1.0 / runs.len() as f64;
    for (run, mean) in runs.iter().zip(&without) {
        for frame in start..count {
            squares[frame] += share * mean_square_distance(&run.frames[frame], &mean[frame]);
        }
    }
    let initial: Vec<&InitialFrames> = runs.iter().map(|run| &run.initial).collect();
    let mut rollouts = Rollout::several(simulator, &initial);
    for frame in start..count {
        for (rollout, mean) in rollouts.iter_mut().zip(&without) {
            match rollout.advance() {
                Ok(positions) => {
                    let square = share * mean_square_distance(positions, &mean[frame]);
                    predicted[frame] = predicted[frame].map(|sum| sum + square);
                }
                Err(error) => {
                    predicted[frame..].fill(None);
                    failure.get_or_insert_with(|| error.to_string());
                }
            }
        }
        // Their mean ends with the first.
        if failure.is_some() {
            break;
        }
    }
    let mut rows: Vec<TruthRow> = (start..count)
        .map(|frame| TruthRow {
            time: first.times[frame],
            spread: squares[frame].sqrt(),
            distance: predicted[frame].map(f64::sqrt),
            others: vec![None; others.len()],
        })
        .collect();
    for (place, path) in others.iter().enumerate() {
        if path.exists() {
            let distances = distances_of(path, &seeds.files[0], first, &without)?;
            for (row, distance) in rows.iter_mut().zip(&distances[start..]) {
                row.others[place] = *distance;
            }
        }
    }
    Ok(Some(AgainstTruth {
        scene: seeds.name(),
        class: seeds.class.clone(),
        seeds: runs.len(),
        spacing: first.initial.scene.domain.spacing(),
        rows,
        failure,
    }))
}

/// A run of the truth in the model's frames.
struct Run {
    initial: InitialFrames,
    times: Vec<f64>,
    frames: Vec<Vec<[f64; 2]>>,
}

impl Run {
    fn read(path: &Path, simulator: &Simulator) -> Result<Self, EvaluationError> {
        let initial = InitialFrames::from_trajectory(path, 0, simulator)?;
        let trajectory = Trajectory::open(path)?;
        let (own, found) = (simulator.training.frame_interval, trajectory.header().frame_interval);
        let stride = stride(own, found, || path.display().to_string())?;
        let frames = (0..trajectory.frames()).step_by(stride);
        let frames = frames.map(|frame| trajectory.frame(frame)).collect::<Result<Vec<_>, _>>()?;
        let (times, frames) = frames.into_iter().map(|frame| (frame.time, frame.position)).unzip();
        Ok(Self { initial, times, frames })
    }
}

/// Mean positions (m) of all runs but one in a frame.
fn mean_without(runs: &[Run], left_out: usize, frame: usize) -> Vec<[f64; 2]> {
    let others = || runs.iter().enumerate().filter(|(k, _)| *k != left_out).map(|(_, run)| run);
    let share = 1.0 / (runs.len() - 1) as f64;
    let mean = |point: usize| {
        [0, 1].map(|k| share * others().map(|run| run.frames[frame][point][k]).sum::<f64>())
    };
    (0..runs[0].frames[frame].len()).map(mean).collect()
}

/// Distances (m) of a run from the truth in the model's frames; `None` where it has none. Points of another size are
/// averaged over the squares of the coarser ones.
fn distances_of(
    path: &Path,
    truth: &Path,
    first: &Run,
    without: &[Vec<Vec<[f64; 2]>>],
) -> Result<Vec<Option<f64>>, EvaluationError> {
    let (own, parts) = common_parts(path, truth)?;
    let mut distances = vec![None; first.times.len()];
    for frames in common_frames(&[own.time(), &first.times]) {
        let [mine, truths] = [frames[0], frames[1]];
        if truths >= without[0].len() {
            continue;
        }
        let positions = own.frame(mine)?.position;
        let square = |mean: &Vec<Vec<[f64; 2]>>| {
            parts.distance(&positions, &mean[truths]).powi(2) / without.len() as f64
        };
        distances[truths] = Some(without.iter().map(square).sum::<f64>().sqrt());
    }
    Ok(distances)
}

/// A run, and the parts of the material that it has in common with the truth.
fn common_parts(path: &Path, truth: &Path) -> Result<(Trajectory, Parts), EvaluationError> {
    let [own, reference] = [Trajectory::open(path)?, Trajectory::open(truth)?];
    let other_scene =
        || EvaluationError::OtherScene { path: truth.to_owned(), other: path.to_owned() };
    let parts = Parts::of(&own, &reference)?.ok_or_else(other_scene)?;
    Ok((own, parts))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seeds at 0, 1 and 2 m: means without one are at 1.5, 1 and 0.5 m, so one seed is 1.5, 0 and 1.5 m away.
    #[test]
    fn the_mean_leaves_out_the_seed_that_is_compared() {
        let points: Vec<[f64; 2]> = vec![[0.0, 0.0], [1.0, 0.0]];
        let runs = [0.0, 1.0, 2.0].map(|d| vec![points.iter().map(|[x, y]| [x + d, *y]).collect()]);
        let runs: Vec<Run> = runs.into_iter().map(run).collect();
        let apart = |k: usize| mean_square_distance(&runs[k].frames[0], &mean_without(&runs, k, 0));
        assert_eq!([0, 1, 2].map(apart), [2.25, 0.0, 2.25]);
    }

    fn run(frames: Vec<Vec<[f64; 2]>>) -> Run {
        let text = "duration = 0.1\n[domain]\nsize = [2.0, 2.0]\n[[column]]\nsize = [0.5, 0.5]\n\
                    [material]\nkind = \"mu-i\"\n";
        let scene = dempm::scene::Scene::parse(text, "scene.toml").unwrap();
        let simulation = dempm::simulation::Simulation::new(scene.clone()).unwrap();
        let initial = InitialFrames {
            scene,
            header: simulation.header(String::new()),
            points: simulation.static_points(),
            positions: Vec::new(),
            velocities: Vec::new(),
            time: 0.0,
            statics: Vec::new(),
            frames: 1,
            simulated_in: 0.0,
        };
        Run { initial, times: vec![0.0; frames.len()], frames }
    }

    /// A distance of 4 mm over a spread of 1 mm is no difference between points 62.5 mm apart.
    #[test]
    fn ratios_have_a_floor() {
        let row = |distance| TruthRow { time: 1.0, spread: 0.001, distance, others: vec![None] };
        let scene = |distance| AgainstTruth {
            scene: "a".to_owned(),
            class: "a".to_owned(),
            seeds: 2,
            spacing: 0.0625,
            rows: vec![row(distance)],
            failure: None,
        };
        assert!((scene(Some(0.004)).worst() - 0.64).abs() < 1e-12);
        assert_eq!(scene(None).worst(), f64::INFINITY);
        assert_eq!(scene(None).worst_of(0), None);
    }
}
