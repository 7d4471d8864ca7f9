//! The frames that a rollout starts from: simulated, or taken from a trajectory.

use std::path::{Path, PathBuf};
use std::time::Instant;

use dempm::scene::{Scene, SceneError};
use dempm::simulation::{Simulation, SimulationError};
use dempm::trajectory::{Frame, Header, Points, Trajectory, TrajectoryError};
use files::utc_now;

use crate::node_features::{Missing, static_features};
use crate::simulator::Simulator;

/// Relative difference of times that is rounding.
pub(crate) const ROUNDING: f64 = 1e-6;

/// Frames as a model wants them, and where they came from.
#[derive(Clone)]
pub struct Start {
    /// The scene: its walls and boxes.
    pub scene: Scene,
    /// The run that it stands for.
    pub header: Header,
    /// What never changes of the points.
    pub points: Points,
    /// Positions, m, frame after frame, the oldest first; at least one.
    pub positions: Vec<Vec<[f64; 2]>>,
    /// Velocities of the same, m/s.
    pub velocities: Vec<Vec<[f64; 2]>>,
    /// Time of the first of them, s.
    pub time: f64,
    /// Features of the points that never change.
    pub statics: Vec<f32>,
    /// Frames to the end of the scene or trajectory, those above included.
    pub frames: usize,
    /// Wall time of simulating the frames, s; 0 if they were taken from a trajectory.
    pub simulated_in: f64,
}

/// Frames that a rollout cannot start from.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum StartError {
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    #[diagnostic(transparent)]
    Simulation(#[from] SimulationError),
    #[error(transparent)]
    #[diagnostic(transparent)]
    Trajectory(#[from] TrajectoryError),
    #[error("{place}: the model has a frame every {model} s, which is no multiple of {found} s")]
    Interval { place: String, model: f64, found: f64 },
    #[error("{}: from frame {first} on there are {found} frames {stride} apart, but the model starts from {needed}", path.display())]
    TooShort { path: PathBuf, first: usize, found: usize, stride: usize, needed: usize },
    #[error("{place}")]
    #[diagnostic(help("the model has to know it: list it in `output.fields` of the scene"))]
    Field { place: String, source: Missing },
    #[error("{place}: the position of point {point} in frame {frame} is not finite")]
    NotFinite { place: String, frame: usize, point: usize },
}

impl Start {
    /// Simulates the first frames of a scene, on the simulator's GPU if it has one.
    ///
    /// # Errors
    /// If the simulation fails or its step does not divide the time between the model's frames.
    pub fn from_scene(mut scene: Scene, simulator: &Simulator) -> Result<Self, StartError> {
        let interval = simulator.training.frame_interval;
        let steps = stride(interval, scene.step, || format!("{}: `step`", scene.name))?;
        let frames = (scene.duration / interval * (1.0 + ROUNDING)) as usize + 1;
        // A simulation on a GPU stops at frames only.
        scene.frame_interval = interval;
        let mut simulation = Simulation::new(scene.clone())?;
        if let Some(device) = &simulator.gpu {
            simulation.move_to(device, None)?;
        }
        let mut start = Self {
            header: simulation.header(utc_now()),
            points: simulation.static_points(),
            scene,
            positions: Vec::new(),
            velocities: Vec::new(),
            time: 0.0,
            statics: Vec::new(),
            frames: frames.max(simulator.first_frames()),
            simulated_in: 0.0,
        };
        let place = start.scene.name.clone();
        start.statics = statics(simulator, &place, || Ok(simulation.frame()))?;
        let began = Instant::now();
        for frame in 0..simulator.first_frames() {
            while simulation.state.step < frame * steps {
                simulation.advance()?;
            }
            let now = simulation.frame();
            start.positions.push(now.position);
            start.velocities.push(now.velocity);
        }
        start.simulated_in = began.elapsed().as_secs_f64();
        Ok(start)
    }

    /// Takes frames of a trajectory, from frame `first` on.
    ///
    /// # Errors
    /// If the file cannot be read, its frames do not fit those of the model or are too few.
    pub fn from_trajectory(
        path: &Path,
        first: usize,
        simulator: &Simulator,
    ) -> Result<Self, StartError> {
        let trajectory = Trajectory::open(path)?;
        let header = trajectory.header().clone();
        let place = path.display().to_string();
        let stride =
            stride(simulator.training.frame_interval, header.frame_interval, || place.clone())?;
        let found = trajectory.frames().saturating_sub(first).div_ceil(stride);
        let needed = if first == 0 { simulator.first_frames() } else { simulator.config.window() };
        if found < needed {
            return Err(StartError::TooShort {
                path: path.to_owned(),
                first,
                found,
                stride,
                needed,
            });
        }
        let mut start = Self {
            scene: Scene::parse(&header.scene, &format!("{place}, scene"))?,
            header,
            points: trajectory.points().clone(),
            positions: Vec::new(),
            velocities: Vec::new(),
            time: trajectory.time()[first],
            statics: statics(simulator, &place, || Ok(trajectory.frame(0)?))?,
            frames: found,
            simulated_in: 0.0,
        };
        for frame in (first..).step_by(stride).take(needed) {
            let now = trajectory.frame(frame)?;
            if let Some(point) = now.position.iter().position(|x| !x.iter().all(|x| x.is_finite()))
            {
                return Err(StartError::NotFinite { place, frame, point });
            }
            start.positions.push(now.position);
            start.velocities.push(now.velocity);
        }
        Ok(start)
    }
}

impl Start {
    /// So many frames that end with the last of the start. What is missing at its beginning are
    /// frames from before, `interval` (s) apart, in which every point moves as it does in the first.
    pub fn window(&self, frames: usize, interval: f64) -> Vec<Vec<[f64; 2]>> {
        let missing = frames.saturating_sub(self.positions.len());
        let before = (1..=missing).rev().map(|back| {
            let time = -(back as f64 * interval);
            let points = self.positions[0].iter().zip(&self.velocities[0]);
            points.map(|(x, v)| moved(*x, *v, time)).collect()
        });
        let known = self.positions.iter().skip(self.positions.len().saturating_sub(frames));
        before.chain(known.cloned()).collect()
    }
}

/// Where a point at `x` (m) is after a time (s), or was before if it is negative, at a velocity (m/s).
pub fn moved(x: [f64; 2], v: [f64; 2], time: f64) -> [f64; 2] {
    [0, 1].map(|k| x[k] + v[k] * time)
}

/// The features that never change, from the `first` frame; none if the model has none.
///
/// # Errors
/// If the frame lacks what they are made of.
pub fn statics(
    simulator: &Simulator,
    place: &str,
    first: impl FnOnce() -> Result<Frame, StartError>,
) -> Result<Vec<f32>, StartError> {
    let features = &simulator.config.node_features;
    if !features.iter().any(|feature| feature.is_static()) {
        return Ok(Vec::new());
    }
    static_features(features, &first()?)
        .map_err(|source| StartError::Field { place: place.to_owned(), source })
}

/// How many times `short` (s) fits into `long`, a whole number.
pub fn stride(long: f64, short: f64, place: impl FnOnce() -> String) -> Result<usize, StartError> {
    let ratio = long / short;
    let whole = ratio.round();
    if whole >= 1.0 && (ratio - whole).abs() <= ROUNDING * whole {
        Ok(whole as usize)
    } else {
        Err(StartError::Interval { place: place(), model: long, found: short })
    }
}
