//! Rollouts on the device: all state stays there, and a predicted frame is one launch of a captured
//! CUDA graph.

use std::collections::VecDeque;
use std::sync::Arc;

use cudarc::driver::sys::{CUgraphInstantiate_flags, CUstreamCaptureMode};
use cudarc::driver::{CudaGraph, CudaSlice, PinnedHostSlice};
use gpu::Device;

use super::batch::EDGES_PER_POINT;
use super::error::CudaError;
use super::frame_builder::{FrameBuilder, NewFrame};
use super::integrator::{BLOCK, Frames, Integrator, Landing, Motion};
use super::network::CudaNetwork;
use super::ops::frame_input::FrameInput;
use super::support::Capacity;
use crate::diagnostics::CrowdingLimit;
use crate::features::{Normalisation, Obstacle, mirrored};
use crate::network::{ModelConfig, ModelKind};
use crate::rollout::RolloutError;

/// One over the part of their edges by which mirror images may differ.
const ROUNDING: usize = 64;

/// What computes accelerations in a rollout.
pub trait Network {
    /// Allocates memory for frames of so many points and edges.
    ///
    /// # Errors
    /// Too little memory.
    fn reserve(&mut self, points: usize, edges: usize) -> Result<(), CudaError>;

    /// Queues the computation of the normalised accelerations, points x dimensions, of the window
    /// that ends with `frame`, on the device's stream, without waiting, so that it can be captured in
    /// a CUDA graph.
    ///
    /// Frames come one after the other, those of the first window too, of which only the last has a
    /// result. All have the features of later frames; the velocities of the first one are to be
    /// ignored. `before` is the frame before.
    ///
    /// # Errors
    /// A launch was refused.
    fn accelerations(
        &mut self,
        frame: &FrameInput,
        before: &FrameInput,
    ) -> Result<&CudaSlice<f32>, CudaError>;
}

impl Network for CudaNetwork {
    fn reserve(&mut self, points: usize, edges: usize) -> Result<(), CudaError> {
        self.grow(Capacity { points, edges })
    }

    fn accelerations(
        &mut self,
        frame: &FrameInput,
        before: &FrameInput,
    ) -> Result<&CudaSlice<f32>, CudaError> {
        self.advance(frame, before)
    }
}

/// What a rollout starts from.
#[derive(Clone, Copy, Debug)]
pub struct Past<'a> {
    /// Positions (m) in a window of frames,
    pub window: &'a [Vec<[f64; 2]>],
    /// and the number of the frame that follows.
    pub next: usize,
    /// Features that never change, of each point.
    pub statics: &'a [f32],
}

/// A rollout on the device.
pub struct CudaRollout<N> {
    device: Arc<Device>,
    network: N,
    builder: FrameBuilder,
    /// Boxes of each window as they are at the last frame that the host has seen.
    obstacles: Vec<Vec<Obstacle>>,
    integrator: Integrator,
    packing: CrowdingLimit,
    config: ModelConfig,
    /// Width of the domain, if each frame is followed by its mirror image.
    mirror: Option<f64>,
    /// The frames of the window take turns: the newest takes the place of the oldest.
    positions: Vec<CudaSlice<f32>>,
    /// The newest frame and the one before, in turn.
    inputs: Vec<FrameInput>,
    /// The last frames that the host has seen, as many as the window has.
    window: VecDeque<Vec<[f64; 2]>>,
    /// Number of the frame that follows them.
    frame: usize,
    /// Frames queued, and blocks returned to the caller, since [`begin`](Self::begin).
    queued: usize,
    returned: usize,
    /// Where the blocks arrive in turn, with the most edges of their frames.
    landings: [(Landing, PinnedHostSlice<u64>); 2],
    /// The work of a frame, for each phase of the buffers that take turns.
    graphs: Vec<Option<CudaGraph>>,
}

impl<N: Network> CudaRollout<N> {
    /// A rollout that goes on from `past`.
    ///
    /// # Errors
    /// Too little memory, or no compiler.
    pub fn new(
        device: &Arc<Device>,
        config: &ModelConfig,
        norm: &Normalisation,
        motion: &Motion,
        past: Past,
        network: N,
    ) -> Result<Self, CudaError> {
        let Past { window, next, statics } = past;
        let points = window[0].len();
        let bounds = motion.constraints.domain().map(|length| [0.0, length]);
        // The images are a second window beside the first.
        let windows = if motion.mirror { 2 } else { 1 };
        let mut builder =
            FrameBuilder::new(device, config, norm, &bounds, &vec![points; windows], 1)?;
        builder.set_statics(&statics.repeat(windows))?;
        let now = motion.start + (next - 1) as f64 * motion.interval;
        let obstacles = motion.constraints.obstacles(now, motion.interval);
        let width = motion.constraints.domain()[0];
        let images = obstacles.iter().map(|obstacle| obstacle.mirrored(width)).collect();
        let obstacles = [obstacles, images][..windows].to_vec();
        let integrator = Integrator::new(device, config, norm, motion, points)?;
        let landing = || -> Result<_, CudaError> {
            // SAFETY: read after a copy has filled it only.
            let needed = unsafe { device.context().alloc_pinned_with_flags(1, 0) }?;
            Ok((integrator.landing()?, needed))
        };
        let mut rollout = Self {
            network,
            landings: [landing()?, landing()?],
            integrator,
            positions: window
                .iter()
                .map(|_| device.zeros(2 * windows * points))
                .collect::<Result<_, _>>()?,
            inputs: Vec::new(),
            config: config.clone(),
            packing: motion.packing,
            mirror: motion.mirror.then(|| motion.constraints.domain()[0]),
            builder,
            obstacles,
            window: window.iter().cloned().collect(),
            frame: next,
            queued: 0,
            returned: 0,
            graphs: Vec::new(),
            device: device.clone(),
        };
        rollout.grow(EDGES_PER_POINT * rollout.builder.points())?;
        rollout.begin()?;
        Ok(rollout)
    }

    /// Allocates frames and the network for so many edges.
    fn grow(&mut self, edges: usize) -> Result<(), CudaError> {
        self.device.stream().synchronize()?;
        self.graphs.clear();
        self.inputs.clear();
        self.network.reserve(self.builder.points(), edges)?;
        for _ in 0..2 {
            self.inputs.push(self.builder.allocate(edges)?);
        }
        Ok(())
    }

    /// Uploads the window that the host knows.
    fn begin(&mut self) -> Result<(), CudaError> {
        let stream = self.device.stream().clone();
        let frames = self.window.len();
        (self.queued, self.returned) = (0, 0);
        self.builder.set_obstacles(&self.obstacles)?;
        self.integrator.begin([&self.window[frames - 2], &self.window[frames - 1]], self.frame)?;
        for (position, frame) in self.positions.iter_mut().zip(&self.window) {
            let mut single: Vec<f32> = frame.as_flattened().iter().map(|&x| x as f32).collect();
            if let Some(width) = self.mirror {
                single.extend(mirrored(&single, width));
            }
            stream.memcpy_htod(&single, position)?;
        }
        loop {
            for position in &self.positions {
                let (past, frame) = (&[position.as_view()], &mut self.inputs[0]);
                self.builder.graphs(&mut [NewFrame { past, known: 1, back: 0, frame }])?;
            }
            let needed = self.builder.needed()?;
            if needed <= self.capacity() {
                break;
            }
            self.grow(needed + needed / 4)?;
        }
        self.graphs.clear();
        self.graphs
            .resize_with(if frames.is_multiple_of(2) { frames } else { 2 * frames }, || None);
        self.input(0, frames - 1)?;
        for frame in 1..frames {
            self.network.accelerations(&self.inputs[(frame - 1) % 2], &self.inputs[frame % 2])?;
            self.input(frame, frames - 1 - frame)?;
        }
        Ok(())
    }

    /// Edges that a frame has memory for.
    fn capacity(&self) -> usize {
        self.inputs[0].graph.capacity
    }

    /// Queues graph and features of a frame, counted from the first of the window that the host knew.
    /// That one's velocities are unknown: they are computed with the last frame of the window, and
    /// ignored. The newest frame is `back` frames later.
    fn input(&mut self, frame: usize, back: usize) -> Result<(), CudaError> {
        let frames = self.positions.len();
        let known = match self.config.kind {
            ModelKind::Tgnns => 2,
            ModelKind::Gns => self.config.frames,
        };
        let past: Vec<_> = (frame + 1..=frame + frames)
            .map(|frame| self.positions[frame % frames].as_view())
            .collect();
        let mut new = [NewFrame { past: &past, known, back, frame: &mut self.inputs[frame % 2] }];
        self.builder.graphs(&mut new)?;
        Ok(self.builder.features(&mut new)?)
    }

    /// Queues one frame: acceleration of the network, semi-implicit Euler, walls and boxes; then the
    /// new frame's graph and features.
    fn queue(&mut self) -> Result<(), CudaError> {
        let frames = self.positions.len();
        let new = frames + self.queued;
        let [newest, before] = [1, 2].map(|k| &self.inputs[(new - k) % 2]);
        let output = self.network.accelerations(newest, before)?;
        self.integrator.step(output, &mut self.positions[new % frames])?;
        self.builder.next_frame()?;
        self.input(new, 0)
    }

    /// Queues one frame, as a CUDA graph but for the first, which loads the kernels.
    fn step(&mut self) -> Result<(), CudaError> {
        let phase = self.queued % self.graphs.len();
        if self.queued == 0 {
            self.queue()?;
        } else {
            if self.graphs[phase].is_none() {
                self.graphs[phase] = self.capture()?;
            }
            match &self.graphs[phase] {
                Some(graph) => graph.launch()?,
                None => self.queue()?,
            }
        }
        self.queued += 1;
        Ok(())
    }

    fn capture(&mut self) -> Result<Option<CudaGraph>, CudaError> {
        let stream = self.device.stream().clone();
        stream.begin_capture(CUstreamCaptureMode::CU_STREAM_CAPTURE_MODE_THREAD_LOCAL)?;
        let queued = self.queue();
        // Ended in any case, lest the stream stay unusable.
        let graph = stream.end_capture(CUgraphInstantiate_flags(0));
        queued?;
        Ok(graph?)
    }

    /// Queues a block of frames and the copy of its results.
    fn queue_block(&mut self) -> Result<(), CudaError> {
        let block = self.queued / BLOCK;
        (0..BLOCK).try_for_each(|_| self.step())?;
        let (landing, needed) = &mut self.landings[block % 2];
        self.builder.copy_needed(needed)?;
        Ok(self.integrator.copy_block(block, landing)?)
    }

    /// Predicts [`BLOCK`] frames; fewer if one makes no sense, and why. Meanwhile the device computes
    /// the next block.
    ///
    /// # Errors
    /// Too little memory for the edges, or a kernel failed.
    pub fn block(&mut self) -> Result<(Frames, Option<RolloutError>), CudaError> {
        let most = self.packing.most_edges(self.builder.points());
        // Images have the same edges but for rounding.
        let most_capacity = most + most / ROUNDING;
        let needed = loop {
            while self.queued < (self.returned + 2) * BLOCK {
                self.queue_block()?;
            }
            let (landing, needed) = &self.landings[self.returned % 2];
            landing.wait()?;
            let needed = needed.as_slice()?[0];
            let needed = usize::try_from(needed).unwrap_or(usize::MAX);
            if needed <= self.capacity() || self.capacity() >= most_capacity {
                break needed;
            }
            // Again from the start of the block, with more memory.
            self.grow(needed.saturating_add(needed / 4).min(most_capacity))?;
            self.begin()?;
        };
        let (mut frames, mut failure) =
            self.integrator.block(&self.landings[self.returned % 2].0, self.frame)?;
        if needed > most {
            // One of them, or one after a failure. Those after it may have lacked memory.
            let check = |(k, frame): (usize, &Vec<_>)| {
                let error = self.packing.check(self.frame + k, frame).err()?;
                Some((k, error))
            };
            if let Some((good, error)) = frames.iter().enumerate().find_map(check) {
                frames.truncate(good);
                failure = Some(error);
            }
        }
        self.returned += 1;
        self.frame += frames.len();
        for _ in &frames {
            self.obstacles.iter_mut().flatten().for_each(Obstacle::advance);
        }
        for frame in frames.iter().rev().take(self.window.len()).rev() {
            self.window.pop_front();
            self.window.push_back(frame.clone());
        }
        Ok((frames, failure))
    }
}
