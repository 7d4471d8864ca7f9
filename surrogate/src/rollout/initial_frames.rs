//! Initial frames of a rollout: simulated, or read from a trajectory.

use std::path::{Path, PathBuf};
use std::time::Instant;

use dempm::scene::{Scene, SceneError};
use dempm::simulation::{Simulation, SimulationError};
use dempm::trajectory::{Frame, Header, Points, Trajectory, TrajectoryError};
use files::utc_now;

use crate::data::extrapolate;
use crate::features::{MissingField, static_features};
use crate::simulator::{ROUNDING, Simulator};

/// The frames that a rollout starts from.
#[derive(Clone)]
pub struct InitialFrames {
    /// The scene, with its walls and boxes.
    pub scene: Scene,
    /// Header of the run that the rollout replaces.
    pub header: Header,
    /// Constant properties of the points.
    pub points: Points,
    /// Positions (m) of at least one frame, the oldest first.
    pub positions: Vec<Vec<[f64; 2]>>,
    /// Velocities in the same frames, m/s.
    pub velocities: Vec<Vec<[f64; 2]>>,
    /// Time of the first of them, s.
    pub time: f64,
    /// Static features of the points, points x columns.
    pub statics: Vec<f32>,
    /// Frames to the end of the scene or trajectory, the initial ones included.
    pub frames: usize,
    /// Wall time of simulating the frames, s; 0 if they were read from a trajectory.
    pub simulated_in: f64,
}

/// Frames that a rollout cannot start from.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum InitialFramesError {
    /// The scene in a trajectory is invalid.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(#[from] SceneError),
    /// The first frames cannot be simulated.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Simulation(#[from] SimulationError),
    /// The trajectory cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Trajectory(#[from] TrajectoryError),
    /// The model's time between frames is no multiple of the step or frame interval found.
    #[error(
        "{place}: the model's frames are {model} s apart, which is not a multiple of {found} s"
    )]
    Interval {
        /// File, or scene and key.
        place: String,
        /// Time between the model's frames, s.
        model: f64,
        /// Step of the scene or time between frames of the trajectory, s.
        found: f64,
    },
    /// The trajectory has too few frames.
    #[error(
        "{}: the model needs {needed} initial frames {stride} apart, but from frame {first} on there \
         are {found}", path.display()
    )]
    TooShort {
        /// The trajectory file.
        path: PathBuf,
        /// First frame asked for.
        first: usize,
        /// Frames of the model's interval from there on.
        found: usize,
        /// Frames of the file per frame of the model.
        stride: usize,
        /// Frames that the model starts from.
        needed: usize,
    },
    /// The first frame lacks a field that a node feature needs.
    #[error("{place}")]
    #[diagnostic(help("the network needs it: list it in `output.fields` of the scene"))]
    Field {
        /// File or scene.
        place: String,
        /// The field.
        source: MissingField,
    },
    /// A position is NaN or infinite.
    #[error("{place}: the position of point {point} in frame {frame} is not finite")]
    NotFinite {
        /// The trajectory file.
        place: String,
        /// Frame of the file.
        frame: usize,
        /// Index of the point.
        point: usize,
    },
}

impl InitialFrames {
    /// Simulates the first frames of a scene, on the simulator's GPU if it has one.
    ///
    /// # Errors
    /// If the simulation fails, or its step does not divide the time between the model's frames.
    pub fn from_scene(mut scene: Scene, simulator: &Simulator) -> Result<Self, InitialFramesError> {
        let interval = simulator.training.frame_interval;
        let steps = stride(interval, scene.step, || format!("{}: `step`", scene.name))?;
        let frames = (scene.duration / interval * (1.0 + ROUNDING)) as usize + 1;
        // A simulation on a GPU stops at frames only.
        scene.frame_interval = interval;
        let mut simulation = Simulation::prepare(scene.clone(), simulator.gpu.as_ref(), None)?;
        if let Some(device) = &simulator.gpu {
            simulation.move_to(device, None)?;
        }
        let mut initial = Self {
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
        let place = initial.scene.name.clone();
        initial.statics =
            static_features_of(simulator, &place, &initial.scene, || Ok(simulation.frame()))?;
        let began = Instant::now();
        for frame in 0..simulator.first_frames() {
            while simulation.step < frame * steps {
                simulation.advance()?;
            }
            let now = simulation.frame();
            initial.positions.push(now.position);
            initial.velocities.push(now.velocity);
        }
        initial.simulated_in = began.elapsed().as_secs_f64();
        Ok(initial)
    }

    /// Reads frames of a trajectory, from frame `first` on.
    ///
    /// # Errors
    /// If the file cannot be read, its frame interval does not divide the model's, or it has too
    /// few frames.
    pub fn from_trajectory(
        path: &Path,
        first: usize,
        simulator: &Simulator,
    ) -> Result<Self, InitialFramesError> {
        let trajectory = Trajectory::open(path)?;
        let header = trajectory.header().clone();
        let place = path.display().to_string();
        let stride =
            stride(simulator.training.frame_interval, header.frame_interval, || place.clone())?;
        let found = trajectory.frames().saturating_sub(first).div_ceil(stride);
        let needed = if first == 0 { simulator.first_frames() } else { simulator.config.window() };
        if found < needed {
            return Err(InitialFramesError::TooShort {
                path: path.to_owned(),
                first,
                found,
                stride,
                needed,
            });
        }
        let scene = Scene::parse(&header.scene, &format!("{place}, scene"))?;
        let first_frame = || Ok(trajectory.frame(0)?);
        let mut initial = Self {
            statics: static_features_of(simulator, &place, &scene, first_frame)?,
            scene,
            header,
            points: trajectory.points().clone(),
            positions: Vec::new(),
            velocities: Vec::new(),
            time: trajectory.time()[first],
            frames: found,
            simulated_in: 0.0,
        };
        for frame in (first..).step_by(stride).take(needed) {
            let now = trajectory.frame(frame)?;
            if let Some(point) = now.position.iter().position(|x| !x.iter().all(|x| x.is_finite()))
            {
                return Err(InitialFramesError::NotFinite { place, frame, point });
            }
            initial.positions.push(now.position);
            initial.velocities.push(now.velocity);
        }
        Ok(initial)
    }
}

impl InitialFrames {
    /// Time (s) of the last frame; frames are `interval` (s) apart.
    pub fn last_time(&self, interval: f64) -> f64 {
        self.time + (self.positions.len() - 1) as f64 * interval
    }

    /// The last `frames` frames (positions, m). Missing ones are extrapolated backwards from the
    /// first frame at constant velocity, `interval` (s) apart.
    pub fn window(&self, frames: usize, interval: f64) -> Vec<Vec<[f64; 2]>> {
        let missing = frames.saturating_sub(self.positions.len());
        let before = (1..=missing).rev().map(|back| {
            let time = -(back as f64 * interval);
            let points = self.positions[0].iter().zip(&self.velocities[0]);
            points.map(|(x, v)| extrapolate(*x, *v, time)).collect()
        });
        let known = self.positions.iter().skip(self.positions.len().saturating_sub(frames));
        before.chain(known.cloned()).collect()
    }
}

/// Static features of the points from the `first` frame of a scene; empty if the network has none.
///
/// # Errors
/// If the frame lacks a field that they need.
pub fn static_features_of(
    simulator: &Simulator,
    place: &str,
    scene: &Scene,
    first: impl FnOnce() -> Result<Frame, InitialFramesError>,
) -> Result<Vec<f32>, InitialFramesError> {
    let features = &simulator.config.node_features;
    if !features.iter().any(|feature| feature.is_static()) {
        return Ok(Vec::new());
    }
    static_features(features, &first()?, scene)
        .map_err(|source| InitialFramesError::Field { place: place.to_owned(), source })
}

/// How many times `short` (s) fits into `long` (s).
///
/// # Errors
/// If that is not a whole number, with the `place` of `short`.
pub fn stride(
    long: f64,
    short: f64,
    place: impl FnOnce() -> String,
) -> Result<usize, InitialFramesError> {
    let ratio = long / short;
    let whole = ratio.round();
    if whole >= 1.0 && (ratio - whole).abs() <= ROUNDING * whole {
        Ok(whole as usize)
    } else {
        Err(InitialFramesError::Interval { place: place(), model: long, found: short })
    }
}
