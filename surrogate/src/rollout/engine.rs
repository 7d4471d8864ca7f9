//! A rollout under way.

use std::collections::VecDeque;
use std::sync::Arc;

use super::constraints::Constraints;
use super::error::RolloutError;
use super::initial_frames::InitialFrames;
use crate::cuda::{Capacity, CudaNetwork, CudaRollout, Motion, PredictedFrames, Start};
use crate::diagnostics::CrowdingLimit;
use crate::features::{Obstacle, Window};
use crate::inference::Inference;
use crate::network::parameters::weights;
use crate::simulator::Simulator;

/// Where frames are predicted.
enum Engine {
    /// On the processor.
    Cpu(Box<Inference>, CrowdingLimit),
    /// On a GPU, some frames ahead.
    Cuda(PredictedFrames),
}

/// A rollout under way.
pub struct Rollout<'a> {
    simulator: &'a Simulator,
    engine: Engine,
    constraints: Constraints,
    /// The frames that the network sees next, the oldest first.
    window: VecDeque<Vec<[f64; 2]>>,
    /// Static features of the points.
    statics: Vec<f32>,
    /// Boxes, for the window that the network sees next.
    obstacles: Vec<Obstacle>,
    /// Gravity, m/frame².
    gravity: [f64; 2],
    /// Time of frame 0, s.
    start: f64,
    frame: usize,
}

impl<'a> Rollout<'a> {
    /// Starts after the initial frames. On a GPU, returns once memory and kernels are ready.
    pub fn new(simulator: &'a Simulator, initial: &InitialFrames) -> Self {
        // One of one.
        Self::several(simulator, &[initial]).remove(0)
    }

    /// Starts several rollouts. Those in domains of one size share a GPU, frame by frame, which takes less time than
    /// one after the other: advance them in turn, since each waits for the others. Sums there are rounded in another
    /// order than in a rollout alone.
    pub fn several(simulator: &'a Simulator, starts: &[&InitialFrames]) -> Vec<Self> {
        let alike =
            |a: &&InitialFrames, b: &&InitialFrames| a.scene.domain.size == b.scene.domain.size;
        let engines: Vec<Engine> = match &simulator.gpu {
            Some(device) => {
                let groups = starts.chunk_by(alike);
                groups.flat_map(|group| start_on_gpu(device, simulator, group)).collect()
            }
            None => starts.iter().map(|initial| on_cpu(simulator, initial)).collect(),
        };
        let pairs = starts.iter().zip(engines);
        pairs.map(|(initial, engine)| Self::with_engine(simulator, initial, engine)).collect()
    }

    fn with_engine(simulator: &'a Simulator, initial: &InitialFrames, engine: Engine) -> Self {
        let interval = simulator.training.frame_interval;
        let constraints = Constraints::new(&initial.scene);
        Self {
            simulator,
            engine,
            obstacles: constraints.obstacles(initial.last_time(interval), interval),
            constraints,
            window: initial.window(simulator.config.window(), interval).into(),
            statics: initial.statics.clone(),
            gravity: initial.scene.gravity.map(|g| g * interval * interval),
            start: initial.time,
            frame: initial.positions.len() - 1,
        }
    }

    /// Number of the last frame, counted from the first initial frame.
    pub fn frame(&self) -> usize {
        self.frame
    }

    /// Positions of the last frame, m.
    pub fn last(&self) -> &[[f64; 2]] {
        &self.window[self.window.len() - 1]
    }

    /// Positions of the last frame but one, m.
    pub fn before(&self) -> &[[f64; 2]] {
        &self.window[self.window.len() - 2]
    }

    /// Time of a frame, s.
    fn time(&self, frame: usize) -> f64 {
        self.start + frame as f64 * self.simulator.training.frame_interval
    }

    /// Predicts one frame and returns its positions (m).
    ///
    /// # Errors
    /// If a position is not finite or farther outside the domain than the connection radius, if
    /// points are [crowded](CrowdingLimit), or if the GPU fails. The rollout stays at the frame
    /// before.
    pub fn advance(&mut self) -> Result<&[[f64; 2]], RolloutError> {
        let next = match &mut self.engine {
            Engine::Cuda(frames) => frames.next_frame()?,
            Engine::Cpu(network, limit) => {
                let limit = *limit;
                let frames = self.window.iter().flatten().flatten();
                let positions: &Vec<f32> = &frames.map(|&x| x as f32).collect();
                let points = self.window[0].len();
                let (statics, obstacles) = (&self.statics, &self.obstacles);
                let window = Window { positions, points, statics, obstacles };
                let domain = self.constraints.domain();
                let accelerations =
                    self.simulator.accelerations(network, &window, domain, self.gravity);
                let next = self.integrate(&accelerations)?;
                limit.check(self.frame + 1, &next)?;
                next
            }
        };
        self.window.pop_front();
        self.window.push_back(next);
        self.obstacles.iter_mut().for_each(Obstacle::advance);
        self.frame += 1;
        Ok(&self.window[self.window.len() - 1])
    }

    /// Predicts up to the frame of this number, and shows each to `look`. Returns the failure that ends it earlier.
    ///
    /// # Errors
    /// Those of `look`.
    pub fn up_to<E>(
        &mut self,
        frame: usize,
        mut look: impl FnMut(&Self) -> Result<(), E>,
    ) -> Result<Option<RolloutError>, E> {
        while self.frame < frame {
            if let Err(error) = self.advance() {
                return Ok(Some(error));
            }
            look(self)?;
        }
        Ok(None)
    }

    /// Semi-implicit Euler, then walls and boxes. Accelerations are in m/frame².
    fn integrate(&self, accelerations: &[f64]) -> Result<Vec<[f64; 2]>, RolloutError> {
        let (last, before) = (self.last(), self.before());
        let domain = self.constraints.domain();
        let frame = self.frame + 1;
        let times = [self.time(self.frame), self.time(frame)];
        let mut next = Vec::with_capacity(last.len());
        for (point, a) in accelerations.as_chunks::<2>().0.iter().enumerate() {
            let velocity = [0, 1].map(|k| last[point][k] - before[point][k] + a[k]);
            let free = [0, 1].map(|k| last[point][k] + velocity[k]);
            if !free.iter().all(|x| x.is_finite()) {
                return Err(RolloutError::NotFinite { frame, point });
            }
            let beyond = (0..2).map(|k| (-free[k]).max(free[k] - domain[k])).fold(0.0, f64::max);
            if beyond > self.simulator.config.connection_radius {
                return Err(RolloutError::Left { frame, point, distance: beyond });
            }
            next.push(self.constraints.confine(last[point], free, times));
        }
        Ok(next)
    }
}

fn crowding_limit(simulator: &Simulator, initial: &InitialFrames) -> CrowdingLimit {
    CrowdingLimit::new(simulator.config.connection_radius, initial.scene.domain.spacing())
}

fn on_cpu(simulator: &Simulator, initial: &InitialFrames) -> Engine {
    Engine::Cpu(Box::new(simulator.inference()), crowding_limit(simulator, initial))
}

/// Starts rollouts in domains of one size on a GPU, on a thread and a stream of their own.
fn start_on_gpu(
    device: &Arc<gpu::Device>,
    simulator: &Simulator,
    starts: &[&InitialFrames],
) -> Vec<Engine> {
    let (config, norm) = (simulator.config.clone(), simulator.normalisation.clone());
    let weights = weights(&simulator.model);
    let (device, precision) = (device.clone(), simulator.precision);
    let interval = simulator.training.frame_interval;
    let of_scene = |initial: &&InitialFrames| {
        let window = initial.window(simulator.config.window(), interval);
        let next = initial.positions.len();
        (motion(simulator, initial), window, next, initial.statics.clone())
    };
    let scenes: Vec<_> = starts.iter().map(of_scene).collect();
    let frames = PredictedFrames::start(scenes.len(), move || {
        let device = device.with_own_stream()?;
        let points = scenes.iter().map(|(_, window, ..)| window[0].len()).sum();
        let room = Capacity { points, edges: 1 };
        let mut network = CudaNetwork::new(&device, &config, precision, room, false)?;
        network.set_weights(&weights)?;
        let starts = scenes.iter().map(|(motion, window, next, statics)| {
            let (motion, next) = (motion.clone(), *next);
            Start { motion, window, next, statics }
        });
        CudaRollout::new(&device, &config, &norm, starts.collect(), network)
    });
    frames.into_iter().map(Engine::Cuda).collect()
}

fn motion(simulator: &Simulator, initial: &InitialFrames) -> Motion {
    let interval = simulator.training.frame_interval;
    let relative = f64::from(u8::from(simulator.training.without_gravity));
    Motion {
        constraints: Constraints::new(&initial.scene),
        fall: initial.scene.gravity.map(|g| relative * (g * interval * interval)),
        start: initial.time,
        interval,
        mirror: simulator.mirror,
        packing: crowding_limit(simulator, initial),
    }
}
