//! What the error of a rollout is predicted from: all of it is known without the truth.

use super::error_model::Features;
use super::training_range::FlowState;
use crate::evaluation::mean_square_distance;
use crate::rollout::InitialFrames;
use crate::simulator::Simulator;

/// Least gravity for the time of a fall (m/s²).
const LEAST_GRAVITY: f64 = 1.0e-3;
/// Motion and speed below these parts of point distance and sqrt(g H) are alike.
const LEAST: f64 = 0.01;

/// Follows a rollout.
pub struct ErrorFeatures {
    first: Vec<[f64; 2]>,
    /// Height (m) and time of a fall from it (s).
    height: f64,
    fall: f64,
    spacing: f64,
    interval: f64,
    /// Speed of a fall (m/s).
    speed: f64,
    /// Largest root mean square speed so far (m/s).
    fastest: f64,
    /// Features of the scene alone.
    scene: [f64; 5],
}

impl ErrorFeatures {
    /// Of a rollout from `initial`.
    pub fn new(simulator: &Simulator, initial: &InitialFrames) -> Self {
        let scene = &initial.scene;
        let gravity = scene.gravity[0].hypot(scene.gravity[1]).max(LEAST_GRAVITY);
        let top = initial.positions[0].iter().map(|x| x[1]).fold(0.0, f64::max);
        let spacing = scene.domain.spacing();
        let height = top.max(spacing);
        let rests = scene.resting_columns().iter().all(|rests| *rests)
            && scene.columns.iter().all(|column| column.velocity == [0.0; 2]);
        let (diameter, _) = scene.material.grain();
        let flag = |is: bool| f64::from(u8::from(is));
        Self {
            first: initial.positions[0].clone(),
            height,
            fall: (height / gravity).sqrt(),
            spacing,
            interval: simulator.training.frame_interval,
            speed: (gravity * height).sqrt(),
            fastest: 0.0,
            scene: [
                outside(simulator, initial),
                if diameter > 0.0 { (diameter / spacing).ln() } else { 0.0 },
                flag(!scene.obstacles.is_empty()),
                flag(scene.plate.is_some()),
                flag(!rests),
            ],
        }
    }

    /// Looks at a frame with positions `now`, after those `before` it (m).
    pub fn observe(&mut self, before: &[[f64; 2]], now: &[[f64; 2]]) {
        let speed = mean_square_distance(now, before).sqrt() / self.interval;
        self.fastest = self.fastest.max(speed);
    }

    /// The features at frame number `frame` with positions `now` (m).
    pub fn at(&self, frame: usize, now: &[[f64; 2]]) -> Features {
        let time = frame as f64 * self.interval / self.fall;
        let motion = mean_square_distance(now, &self.first).sqrt() / self.spacing;
        let [outside, grains, boxes, plate, falls] = self.scene;
        [
            time.max(LEAST).ln(),
            (self.height / self.spacing).ln(),
            motion.max(LEAST).ln(),
            (self.fastest / self.speed).max(LEAST).ln(),
            outside,
            grains,
            boxes,
            plate,
            falls,
        ]
    }
}

/// How far the initial frames are outside of the training data; 0 within, and where that is not known.
fn outside(simulator: &Simulator, initial: &InitialFrames) -> f64 {
    let Some(range) = &simulator.training.range else { return 0.0 };
    let interval = simulator.training.frame_interval;
    let [a, b, c] = &initial.window(3, interval)[..] else { return 0.0 };
    range.excess(&FlowState::measure([a, b, c], interval, simulator.config.connection_radius))
}
