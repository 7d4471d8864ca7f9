//! One of the scenes that are rolled out together: what is its own, not the network's.

use std::collections::VecDeque;
use std::sync::Arc;

use gpu::{Device, Error};

use super::integrator::{Frames, Integrator, Landing, Motion};
use crate::features::{Normalisation, Obstacle, mirrored};
use crate::network::ModelConfig;
use crate::rollout::RolloutError;

/// What the rollout of a scene starts from.
pub struct Start<'a> {
    /// What moves its points.
    pub motion: Motion,
    /// Positions (m) in a window of frames,
    pub window: &'a [Vec<[f64; 2]>],
    /// and the number of the frame that follows.
    pub next: usize,
    /// Features that never change, of each point.
    pub statics: &'a [f32],
}

/// A scene that is rolled out. Its points follow each other on the device, and with
/// [`mirror`](Motion::mirror) their images follow them.
pub(super) struct Member {
    motion: Motion,
    /// Features of its points that never change.
    statics: Vec<f32>,
    /// Boxes as they are at the last frame that the host has seen.
    obstacles: Vec<Obstacle>,
    pub integrator: Integrator,
    /// Where blocks arrive in turn.
    pub landings: [Landing; 2],
    /// The last frames that the host has seen, as many as the network's window has.
    window: VecDeque<Vec<[f64; 2]>>,
    /// Number of the frame that follows them.
    frame: usize,
}

impl Member {
    /// # Errors
    /// Too little memory, or no compiler.
    pub fn new(
        device: &Arc<Device>,
        config: &ModelConfig,
        norm: &Normalisation,
        start: Start<'_>,
    ) -> Result<Self, Error> {
        let Start { motion, window, next, statics } = start;
        let now = motion.start + (next - 1) as f64 * motion.interval;
        let integrator = Integrator::new(device, config, norm, &motion, window[0].len())?;
        Ok(Self {
            obstacles: motion.constraints.obstacles(now, motion.interval),
            landings: [integrator.landing()?, integrator.landing()?],
            integrator,
            statics: statics.to_vec(),
            window: window.iter().cloned().collect(),
            frame: next,
            motion,
        })
    }

    /// Width and height of its domain, m.
    pub fn domain(&self) -> [f64; 2] {
        self.motion.constraints.domain()
    }

    /// Its points.
    pub fn points(&self) -> usize {
        self.window[0].len()
    }

    /// Windows that it has on the device: its own, and that of its image.
    pub fn windows(&self) -> usize {
        if self.motion.mirror { 2 } else { 1 }
    }

    /// Largest number of edges of a frame that makes sense, images left out.
    pub fn most_edges(&self) -> usize {
        self.motion.packing.most_edges(self.points())
    }

    /// Static features of all its windows.
    pub fn statics(&self) -> Vec<f32> {
        self.statics.repeat(self.windows())
    }

    /// Boxes of each of its windows.
    pub fn obstacles(&self) -> Vec<Vec<Obstacle>> {
        let width = self.domain()[0];
        let images = self.obstacles.iter().map(|obstacle| obstacle.mirrored(width)).collect();
        [self.obstacles.clone(), images][..self.windows()].to_vec()
    }

    /// Positions (m) of all its windows in a frame of the window that the host knows.
    pub fn positions(&self, frame: usize) -> Vec<f32> {
        let frame = self.window[frame].as_flattened();
        let mut single: Vec<f32> = frame.iter().map(|&x| x as f32).collect();
        if self.motion.mirror {
            single.extend(mirrored(&single, self.domain()[0]));
        }
        single
    }

    /// Goes on from the window that the host knows.
    ///
    /// # Errors
    /// The copy failed.
    pub fn begin(&mut self) -> Result<(), Error> {
        let last = self.window.len() - 1;
        self.integrator.begin([&self.window[last - 1], &self.window[last]], self.frame)
    }

    /// The frames that have landed; fewer if one makes no sense, and why. `crowded`: some of them, or one after a
    /// failure, may have too many edges.
    ///
    /// # Errors
    /// A kernel failed.
    pub fn landed(
        &self,
        landing: usize,
        crowded: bool,
    ) -> Result<(Frames, Option<RolloutError>), Error> {
        let (mut frames, mut failure) =
            self.integrator.block(&self.landings[landing], self.frame)?;
        if crowded {
            let check = |(k, frame): (usize, &Vec<_>)| {
                let error = self.motion.packing.check(self.frame + k, frame).err()?;
                Some((k, error))
            };
            if let Some((good, error)) = frames.iter().enumerate().find_map(check) {
                frames.truncate(good);
                failure = Some(error);
            }
        }
        Ok((frames, failure))
    }

    /// Takes frames as those that the host has seen last.
    pub fn advance(&mut self, frames: &Frames) {
        self.frame += frames.len();
        for _ in frames {
            self.obstacles.iter_mut().for_each(Obstacle::advance);
        }
        let known = self.window.len();
        self.window.extend(frames.iter().skip(frames.len().saturating_sub(known)).cloned());
        self.window.drain(..self.window.len() - known);
    }
}
