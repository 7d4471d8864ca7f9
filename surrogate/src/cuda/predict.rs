//! Rollouts on the device: all state stays there, and a frame is one launch of a CUDA graph.

use std::collections::VecDeque;
use std::sync::Arc;

use cudarc::driver::sys::{CUgraphInstantiate_flags, CUstreamCaptureMode};
use cudarc::driver::{CudaGraph, CudaSlice, PinnedHostSlice};
use gpu::Device;

use super::buffers::FrameInput;
use super::error::CudaError;
use super::features::FrameBuilder;
use super::integrate::{BLOCK, Frames, Integrator, Landing, Motion};
use super::kernels::WIDTH;
use super::network::{Capacity, CudaNetwork};
use crate::config::{ModelConfig, ModelKind};
use crate::features::Normalisation;
use crate::rollout::RolloutError;

/// Room for edges of each point at first; it grows as needed.
const EDGES_PER_POINT: usize = 48;

/// What computes accelerations in a rollout.
pub trait Network {
    /// Makes room for frames of so many points and edges.
    ///
    /// # Errors
    /// Too little memory.
    fn make_room(&mut self, points: usize, edges: usize) -> Result<(), CudaError>;

    /// Queues the computation of the normalised accelerations, points x dimensions, of the window
    /// that ends with `frame`, on the device's stream, without waiting, so that it can be captured in
    /// a CUDA graph.
    ///
    /// Frames come one after the other, those of the first window too, for which there is nothing to
    /// be had but for the last. All have the features of later frames, of which the first one's
    /// velocities are to be ignored. `before` is the frame before.
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
    fn make_room(&mut self, points: usize, edges: usize) -> Result<(), CudaError> {
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

/// Whether networks like this can be rolled out on a GPU.
///
/// # Errors
/// If not: why.
pub fn supports(config: &ModelConfig) -> Result<(), CudaError> {
    let layers = if config.kind == ModelKind::Gns { config.gns_layers } else { 0 };
    for (key, value, most) in [
        ("width", config.width, WIDTH),
        ("node_features", config.node_features.len(), 0),
        ("gns_layers", layers, 0),
    ] {
        if value > most {
            return Err(CudaError::Unsupported { key, value, most });
        }
    }
    Ok(())
}

/// A rollout on the device.
pub struct CudaRollout<N> {
    device: Arc<Device>,
    network: N,
    builder: FrameBuilder,
    integrator: Integrator,
    /// The frames of the window take turns: the newest takes the place of the oldest.
    positions: Vec<CudaSlice<f32>>,
    /// The newest frame and the one before, in turn.
    inputs: Vec<FrameInput>,
    /// The last frames that the host has seen, as many as the window has.
    window: VecDeque<Vec<[f64; 2]>>,
    /// Number of the frame that follows them.
    frame: usize,
    /// Frames queued, and blocks given to the caller, since [`begin`](Self::begin).
    queued: usize,
    given: usize,
    /// Where the blocks arrive in turn.
    landings: [(Landing, PinnedHostSlice<u64>); 2],
    /// The work of a frame, which repeats itself.
    graphs: Vec<Option<CudaGraph>>,
}

impl<N: Network> CudaRollout<N> {
    /// Begins after a window of frames (positions in m), the first of which has number 0.
    ///
    /// # Errors
    /// Too little memory, or no compiler.
    pub fn new(
        device: &Arc<Device>,
        config: &ModelConfig,
        norm: &Normalisation,
        motion: &Motion,
        window: &[Vec<[f64; 2]>],
        network: N,
    ) -> Result<Self, CudaError> {
        let points = window[0].len();
        let bounds = motion.constraints.domain().map(|length| [0.0, length]);
        let builder = FrameBuilder::new(device, config, norm, &bounds, &[points])?;
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
            positions: window.iter().map(|_| device.zeros(2 * points)).collect::<Result<_, _>>()?,
            inputs: Vec::new(),
            builder,
            window: window.iter().cloned().collect(),
            frame: window.len(),
            queued: 0,
            given: 0,
            graphs: Vec::new(),
            device: device.clone(),
        };
        rollout.make_room(EDGES_PER_POINT * points)?;
        rollout.begin()?;
        Ok(rollout)
    }

    fn make_room(&mut self, edges: usize) -> Result<(), CudaError> {
        self.device.stream().synchronize()?;
        self.graphs.clear();
        self.inputs.clear();
        self.network.make_room(self.builder.points(), edges)?;
        for _ in 0..2 {
            self.inputs.push(self.builder.allocate(edges)?);
        }
        Ok(())
    }

    /// Puts the window that the host knows on the device.
    fn begin(&mut self) -> Result<(), CudaError> {
        let stream = self.device.stream().clone();
        let frames = self.window.len();
        (self.queued, self.given) = (0, 0);
        self.integrator.begin([&self.window[frames - 2], &self.window[frames - 1]], self.frame)?;
        for (position, frame) in self.positions.iter_mut().zip(&self.window) {
            let single: Vec<f32> = frame.as_flattened().iter().map(|&x| x as f32).collect();
            stream.memcpy_htod(&single, position)?;
        }
        loop {
            for position in &self.positions {
                self.builder.graph(&position.as_view(), &mut self.inputs[0])?;
            }
            let needed = self.builder.needed()?;
            if needed <= self.room() {
                break;
            }
            self.make_room(needed + needed / 4)?;
        }
        self.graphs.clear();
        self.graphs
            .resize_with(if frames.is_multiple_of(2) { frames } else { 2 * frames }, || None);
        self.input(0)?;
        for frame in 1..frames {
            self.network.accelerations(&self.inputs[(frame - 1) % 2], &self.inputs[frame % 2])?;
            self.input(frame)?;
        }
        Ok(())
    }

    /// Edges that a frame has room for.
    fn room(&self) -> usize {
        self.inputs[0].graph.capacity
    }

    /// Queues graph and features of a frame, counted from the first of the window that the host knew.
    fn input(&mut self, frame: usize) -> Result<(), CudaError> {
        let frames = self.positions.len();
        // The first frame's velocities are unknown, and nobody reads them.
        let [now, before] =
            [frame, frame.saturating_sub(1)].map(|k| self.positions[k % frames].as_view());
        let input = &mut self.inputs[frame % 2];
        self.builder.graph(&now, input)?;
        Ok(self.builder.features(&now, Some(&before), input)?)
    }

    /// Queues one frame: acceleration of the network, semi-implicit Euler, walls and boxes; then the
    /// new frame's graph and features.
    fn queue(&mut self) -> Result<(), CudaError> {
        let frames = self.positions.len();
        let new = frames + self.queued;
        let [newest, before] = [1, 2].map(|k| &self.inputs[(new - k) % 2]);
        let output = self.network.accelerations(newest, before)?;
        self.integrator.step(output, &mut self.positions[new % frames])?;
        self.input(new)
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

    /// Predicts [`BLOCK`] frames; fewer if one makes no sense, and why. The device is left with the
    /// next block to compute.
    ///
    /// # Errors
    /// Too little memory for the edges, or a kernel failed.
    pub fn block(&mut self) -> Result<(Frames, Option<RolloutError>), CudaError> {
        loop {
            while self.queued < (self.given + 2) * BLOCK {
                self.queue_block()?;
            }
            let (landing, needed) = &self.landings[self.given % 2];
            landing.wait()?;
            let needed = needed.as_slice()?[0];
            let needed = usize::try_from(needed).unwrap_or(usize::MAX);
            if needed <= self.room() {
                break;
            }
            // Again from where the block began, with more room.
            self.make_room(needed + needed / 4)?;
            self.begin()?;
        }
        let (frames, failure) =
            self.integrator.block(&self.landings[self.given % 2].0, self.frame)?;
        self.given += 1;
        self.frame += frames.len();
        for frame in frames.iter().rev().take(self.window.len()).rev() {
            self.window.pop_front();
            self.window.push_back(frame.clone());
        }
        Ok((frames, failure))
    }
}
