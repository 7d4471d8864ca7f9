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

    /// Queues the computation of the normalised accelerations of the newest frame, points x
    /// dimensions, on the device's stream, without waiting, so that it can be captured in a CUDA
    /// graph.
    ///
    /// The oldest frame comes first. All have the features of later frames, of which the first one's
    /// velocities are to be ignored. `moved`: the window is that of the call before, moved on by a
    /// frame.
    ///
    /// # Errors
    /// A launch was refused.
    fn accelerations(
        &mut self,
        frames: &[&FrameInput],
        moved: bool,
    ) -> Result<&CudaSlice<f32>, CudaError>;

    /// What is queued is the same again after so many calls, for the same frames in the same places.
    fn period(&self) -> usize;
}

impl Network for CudaNetwork {
    fn make_room(&mut self, points: usize, edges: usize) -> Result<(), CudaError> {
        self.grow(Capacity { points, edges })
    }

    fn accelerations(
        &mut self,
        frames: &[&FrameInput],
        moved: bool,
    ) -> Result<&CudaSlice<f32>, CudaError> {
        self.advance(frames, moved)
    }

    /// The encodings of all frames but the first take turns.
    fn period(&self) -> usize {
        self.config.frames - 1
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
        for _ in 0..self.window.len() {
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
            for (position, input) in self.positions.iter().zip(&mut self.inputs) {
                self.builder.graph(&position.as_view(), input)?;
            }
            let needed = self.builder.needed()?;
            if needed <= self.room() {
                break;
            }
            self.make_room(needed + needed / 4)?;
        }
        self.graphs.clear();
        self.graphs.resize_with(least_common_multiple(frames, self.network.period()), || None);
        // The first frame's velocities are unknown, and nobody reads them.
        (0..frames).try_for_each(|k| self.features(k, k.saturating_sub(1)))
    }

    /// Edges that a frame has room for.
    fn room(&self) -> usize {
        self.inputs[0].graph.capacity
    }

    fn features(&mut self, place: usize, before: usize) -> Result<(), CudaError> {
        let [now, before] = [place, before].map(|k| self.positions[k].as_view());
        Ok(self.builder.features(&now, Some(&before), &mut self.inputs[place])?)
    }

    /// Queues one frame: acceleration of the network, semi-implicit Euler, walls and boxes; then the
    /// new frame's graph and features, in the place of the oldest frame.
    fn queue(&mut self) -> Result<(), CudaError> {
        let frames = self.inputs.len();
        let oldest = self.queued % frames;
        let window: Vec<&FrameInput> =
            (0..frames).map(|k| &self.inputs[(oldest + k) % frames]).collect();
        let output = self.network.accelerations(&window, self.queued > 0)?;
        self.integrator.step(output, &mut self.positions[oldest])?;
        self.builder.graph(&self.positions[oldest].as_view(), &mut self.inputs[oldest])?;
        self.features(oldest, (oldest + frames - 1) % frames)
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

fn least_common_multiple(a: usize, b: usize) -> usize {
    (1..=b).map(|k| a * k).find(|multiple| multiple.is_multiple_of(b)).unwrap_or(a)
}
