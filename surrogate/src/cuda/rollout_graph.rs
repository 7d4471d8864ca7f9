//! Rollouts on the device: all state stays there, and a predicted frame is one launch of a captured
//! CUDA graph. Scenes that are rolled out together are parts of one graph without edges between them.

use std::sync::Arc;

use cudarc::driver::sys::{CUgraphInstantiate_flags, CUstreamCaptureMode};
use cudarc::driver::{CudaGraph, CudaSlice, PinnedHostSlice};
use gpu::Device;

use super::batch::EDGES_PER_POINT;
use super::error::CudaError;
use super::frame_builder::{FrameBuilder, NewFrame};
use super::integrator::{BLOCK, Frames};
use super::member::{Member, Start};
use super::network::CudaNetwork;
use super::ops::frame_input::FrameInput;
use super::support::Capacity;
use crate::features::Normalisation;
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

/// A rollout of scenes on the device.
pub struct CudaRollout<N> {
    device: Arc<Device>,
    network: N,
    builder: FrameBuilder,
    members: Vec<Member>,
    config: ModelConfig,
    norm: Normalisation,
    /// The frames of the window take turns: the newest takes the place of the oldest.
    positions: Vec<CudaSlice<f32>>,
    /// The newest frame and the one before, in turn.
    inputs: Vec<FrameInput>,
    /// Frames queued, and blocks returned to the caller, since [`begin`](Self::begin).
    queued: usize,
    returned: usize,
    /// Where the most edges of the frames of blocks arrive in turn, and those of each window.
    needed: [PinnedHostSlice<u64>; 2],
    /// The work of a frame, for each phase of the buffers that take turns.
    graphs: Vec<Option<CudaGraph>>,
}

impl<N: Network> CudaRollout<N> {
    /// A rollout of scenes in domains of one size.
    ///
    /// # Errors
    /// Too little memory, or no compiler.
    ///
    /// # Panics
    /// Without scenes.
    pub fn new(
        device: &Arc<Device>,
        config: &ModelConfig,
        norm: &Normalisation,
        starts: Vec<Start<'_>>,
        network: N,
    ) -> Result<Self, CudaError> {
        let members = starts.into_iter().map(|start| Member::new(device, config, norm, start));
        let members = members.collect::<Result<_, _>>()?;
        Self::of(device.clone(), config.clone(), norm.clone(), members, network)
    }

    /// The rollout of these scenes, from where they are.
    fn of(
        device: Arc<Device>,
        config: ModelConfig,
        norm: Normalisation,
        members: Vec<Member>,
        network: N,
    ) -> Result<Self, CudaError> {
        let bounds = members[0].domain().map(|length| [0.0, length]);
        let points = members.iter().flat_map(|member| vec![member.points(); member.windows()]);
        let points: Vec<usize> = points.collect();
        let mut builder = FrameBuilder::new(&device, &config, &norm, &bounds, &points, 1)?;
        builder.set_statics(&members.iter().flat_map(Member::statics).collect::<Vec<_>>())?;
        let needed = || {
            // SAFETY: read after a copy has filled it only.
            unsafe { device.context().alloc_pinned_with_flags(1 + points.len(), 0) }
        };
        let mut rollout = Self {
            network,
            needed: [needed()?, needed()?],
            members,
            positions: (0..config.window())
                .map(|_| device.zeros(2 * builder.points()))
                .collect::<Result<_, _>>()?,
            inputs: Vec::new(),
            builder,
            queued: 0,
            returned: 0,
            graphs: Vec::new(),
            config,
            norm,
            device,
        };
        rollout.grow(EDGES_PER_POINT * rollout.builder.points())?;
        rollout.begin()?;
        Ok(rollout)
    }

    /// Goes on with some of the scenes, at least one, from the last frames that [`block`](Self::block) gave.
    ///
    /// # Errors
    /// Too little memory.
    ///
    /// # Panics
    /// Without scenes.
    pub fn keep(self, keep: &[bool]) -> Result<Self, CudaError> {
        self.device.stream().synchronize()?;
        let kept = self.members.into_iter().zip(keep).filter(|(_, keep)| **keep);
        let members = kept.map(|(member, _)| member).collect();
        Self::of(self.device, self.config, self.norm, members, self.network)
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
        let frames = self.positions.len();
        (self.queued, self.returned) = (0, 0);
        let obstacles: Vec<_> = self.members.iter().flat_map(Member::obstacles).collect();
        self.builder.set_obstacles(&obstacles)?;
        self.members.iter_mut().try_for_each(Member::begin)?;
        for (frame, position) in self.positions.iter_mut().enumerate() {
            let all = self.members.iter().flat_map(|member| member.positions(frame));
            stream.memcpy_htod(&all.collect::<Vec<_>>(), position)?;
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
        let mut first = 0;
        for member in &mut self.members {
            member.integrator.step(output, &mut self.positions[new % frames], first)?;
            first += member.windows() * member.points();
        }
        self.builder.next_frame()?;
        self.input(new, 0)?;
        Ok(self.builder.count_windows(&self.inputs[new % 2])?)
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
        self.builder.copy_needed(&mut self.needed[block % 2])?;
        for member in &mut self.members {
            member.integrator.copy_block(block, &mut member.landings[block % 2])?;
        }
        Ok(())
    }

    /// Predicts [`BLOCK`] frames of each scene; fewer if one makes no sense, and why, or if those after them have to be
    /// computed again. Meanwhile the device computes the next block. A scene that has failed must be left out
    /// ([`keep`](Self::keep)).
    ///
    /// # Errors
    /// Too little memory for the edges, or a kernel failed.
    pub fn block(&mut self) -> Result<Vec<(Frames, Option<RolloutError>)>, CudaError> {
        let most: usize = self.members.iter().map(|m| m.windows() * m.most_edges()).sum();
        // Images have the same edges but for rounding.
        let most_capacity = most + most / ROUNDING;
        let (turn, needed) = loop {
            while self.queued < (self.returned + 2) * BLOCK {
                self.queue_block()?;
            }
            let turn = self.returned % 2;
            // The copies queued last.
            if let Some(last) = self.members.last() {
                last.landings[turn].wait()?;
            }
            let needed = self.needed[turn].as_slice()?.to_vec();
            let all = usize::try_from(needed[0]).unwrap_or(usize::MAX);
            if all <= self.capacity() || self.capacity() >= most_capacity {
                break (turn, needed);
            }
            // Again from the start of the block, with more memory.
            self.grow(all.saturating_add(all / 4).min(most_capacity))?;
            self.begin()?;
        };
        self.returned += 1;
        // A graph with more edges than any that makes sense was left without.
        let (mut edges, overflow) = (needed[1..].iter(), needed[0] > self.capacity() as u64);
        let blocks = self.members.iter().map(|member| {
            let own = edges.next().is_some_and(|&edges| edges > member.most_edges() as u64);
            edges.by_ref().take(member.windows() - 1).for_each(drop);
            member.landed(turn, own || overflow)
        });
        let mut blocks: Vec<(Frames, Option<RolloutError>)> = blocks.collect::<Result<_, _>>()?;
        if overflow {
            // Frames after the first that is too crowded lacked edges, those of the other scenes too.
            let good = blocks.iter().map(|(frames, _)| frames.len()).min().unwrap_or(0);
            for (frames, failure) in &mut blocks {
                if frames.len() > good {
                    frames.truncate(good);
                    *failure = None;
                }
            }
        }
        self.members
            .iter_mut()
            .zip(&blocks)
            .for_each(|(member, (frames, _))| member.advance(frames));
        if overflow {
            self.grow(self.capacity())?;
            self.begin()?;
        }
        Ok(blocks)
    }
}
