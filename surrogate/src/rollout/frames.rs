//! Frames of a rollout as trajectory files record them.

use std::collections::BTreeMap;

use dempm::trajectory::Frame;

use super::constraints::Constraints;
use super::initial_frames::InitialFrames;

/// Makes trajectory frames of positions: times, velocities, boxes and budget.
pub struct FrameBuilder<'a> {
    initial: &'a InitialFrames,
    constraints: Constraints,
    /// Time between frames, s.
    interval: f64,
}

impl<'a> FrameBuilder<'a> {
    /// For a rollout that starts from `initial`, with `interval` (s) between its frames.
    pub fn new(initial: &'a InitialFrames, interval: f64) -> Self {
        Self { initial, constraints: Constraints::new(&initial.scene), interval }
    }

    /// The initial frames.
    pub fn initial(&self) -> impl Iterator<Item = Frame> + '_ {
        let frames = self.initial.positions.iter().zip(&self.initial.velocities).enumerate();
        frames.map(|(frame, (x, v))| self.frame(frame, x.clone(), v.clone()))
    }

    /// Frame number `frame` with positions `now` (m). Velocities are differences to the positions
    /// `before` it.
    pub fn predicted(&self, frame: usize, before: &[[f64; 2]], now: &[[f64; 2]]) -> Frame {
        let interval = self.interval;
        let velocity = |(x, b): (&[f64; 2], &[f64; 2])| [0, 1].map(|k| (x[k] - b[k]) / interval);
        self.frame(frame, now.to_vec(), now.iter().zip(before).map(velocity).collect())
    }

    fn frame(&self, frame: usize, position: Vec<[f64; 2]>, velocity: Vec<[f64; 2]>) -> Frame {
        let time = self.initial.time + frame as f64 * self.interval;
        let largest = |k: usize| position.iter().map(|x| x[k]).fold(f64::MIN, f64::max);
        let kinetic = |(v, m): (&[f64; 2], &f64)| 0.5 * m * (v[0] * v[0] + v[1] * v[1]);
        let mass = &self.initial.points.mass;
        let budget = BTreeMap::from([
            ("front".to_owned(), largest(0)),
            ("max_height".to_owned(), largest(1)),
            ("kinetic_energy".to_owned(), velocity.iter().zip(mass).map(kinetic).sum()),
        ]);
        let boxes = self.constraints.boxes(time);
        Frame { time, position, velocity, boxes, budget, ..Frame::default() }
    }
}
