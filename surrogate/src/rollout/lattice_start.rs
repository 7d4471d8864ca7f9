//! The start of a rollout without any simulation: the points of the scene as it is written.

use std::collections::BTreeMap;

use dempm::scene::Scene;
use dempm::trajectory::{Frame, Header, Points};

use super::initial_frames::{InitialFrames, InitialFramesError, static_features_of};
use super::scene_of_training::scene_to_start_from;
use crate::simulator::{ROUNDING, Simulator};

impl InitialFrames {
    /// The frames that a rollout of a scene starts from: the scene as it is written where that is enough, else
    /// simulated. A network that has learnt from discs starts from discs, whichever material the scene names, on the
    /// grid that gives points as many neighbours as in training.
    ///
    /// # Errors
    /// If the simulation fails, or its step does not divide the time between the model's frames.
    pub fn of_scene(scene: &Scene, simulator: &Simulator) -> Result<Self, InitialFramesError> {
        let scene = scene_to_start_from(simulator, scene);
        match Self::from_lattice(&scene, simulator) {
            Some(initial) => Ok(initial),
            None => Self::from_scene(scene, simulator),
        }
    }

    /// The scene at time zero, for a model that starts from one frame and needs no field of it. `None` for others.
    pub fn from_lattice(scene: &Scene, simulator: &Simulator) -> Option<Self> {
        if simulator.first_frames() > 1 {
            return None;
        }
        let interval = simulator.training.frame_interval;
        let points = scene.points();
        let first = Frame {
            position: points.position.clone(),
            velocity: points.velocity.clone(),
            ..Frame::default()
        };
        let statics = static_features_of(simulator, &scene.name, scene, || Ok(first)).ok()?;
        let [width, height] = scene.domain.size;
        let header = Header {
            title: scene.title.clone(),
            scene: scene.text.clone(),
            seed: scene.seed,
            created: String::new(),
            versions: BTreeMap::new(),
            device: String::new(),
            precision: String::new(),
            material: scene.material.name().to_owned(),
            domain: scene.domain.size,
            gravity: scene.gravity,
            grid_cell: scene.domain.cell,
            point_spacing: scene.domain.spacing(),
            time_step: scene.step,
            frame_interval: scene.frame_interval,
            parameters: BTreeMap::new(),
            walls: vec![
                [0.0, 0.0, 0.0, height],
                [width, 0.0, width, height],
                [0.0, 0.0, width, 0.0],
                [0.0, height, width, height],
            ],
        };
        let mass = scene.material.density() * scene.point_area();
        Some(Self {
            header,
            points: Points { mass: vec![mass; points.position.len()], column: points.column },
            scene: scene.clone(),
            positions: vec![points.position],
            velocities: vec![points.velocity],
            time: 0.0,
            statics,
            frames: (scene.duration / interval * (1.0 + ROUNDING)) as usize + 1,
            simulated_in: 0.0,
        })
    }
}
