//! Training batches on the device: positions -> graphs, features.

use std::sync::Arc;

use cudarc::driver::CudaSlice;
use gpu::Device;

use super::buffers::FrameInput;
use super::error::CudaError;
use super::features::FrameBuilder;
use crate::config::{ModelConfig, ModelKind};
use crate::data::Batch;
use crate::features::{Normalisation, Obstacle};

/// Room for edges of each point at first; it grows as needed.
pub const EDGES_PER_POINT: usize = 48;

/// Makes batches, one in the place of the other.
pub struct BatchBuilder {
    device: Arc<Device>,
    config: ModelConfig,
    norm: Normalisation,
    bounds: Vec<[f64; 2]>,
    /// Points of each window of the batch.
    windows: Vec<usize>,
    room: Option<Room>,
}

/// A batch and what it is made with.
struct Room {
    builder: FrameBuilder,
    /// frames of a window x points x dimensions.
    positions: CudaSlice<f32>,
    batch: DeviceBatch,
}

/// What a network learns from in one step.
pub struct DeviceBatch {
    /// The frames that the network has graphs of, oldest first.
    pub frames: Vec<FrameInput>,
    /// Normalised accelerations, points x dimensions.
    pub targets: CudaSlice<f32>,
}

/// Windows side by side.
#[derive(Clone, Debug)]
pub struct HostWindows {
    /// Points of each window.
    pub points: Vec<usize>,
    /// Positions (m) of the points of all windows, frame after frame, the oldest first.
    pub positions: Vec<f32>,
    /// Features that never change, of the points of all windows.
    pub statics: Vec<f32>,
    /// Obstacles of each window.
    pub obstacles: Vec<Vec<Obstacle>>,
    /// Normalised accelerations of the points of all windows.
    pub targets: Vec<f32>,
}

impl HostWindows {
    /// Puts the windows of a batch, at least one, side by side.
    pub fn new(batch: Batch) -> Self {
        let Batch { windows, points, statics, obstacles, targets } = batch;
        let dimensions = targets.len() / points.iter().sum::<usize>().max(1);
        let strides: Vec<usize> = points.iter().map(|points| points * dimensions).collect();
        let frames = windows[0].len() / strides[0].max(1);
        let mut positions = Vec::with_capacity(windows.iter().map(Vec::len).sum());
        for frame in 0..frames {
            for (window, &stride) in windows.iter().zip(&strides) {
                positions.extend_from_slice(&window[frame * stride..(frame + 1) * stride]);
            }
        }
        Self { points, positions, statics: statics.concat(), obstacles, targets }
    }
}

impl BatchBuilder {
    /// `bounds` are the lower and upper wall of each direction (m).
    pub fn new(
        device: &Arc<Device>,
        config: &ModelConfig,
        norm: &Normalisation,
        bounds: &[[f64; 2]],
    ) -> Self {
        Self {
            device: device.clone(),
            config: config.clone(),
            norm: norm.clone(),
            bounds: bounds.to_vec(),
            windows: Vec::new(),
            room: None,
        }
    }

    /// Makes the batch of some windows, at least one point, all with the frames of the network.
    /// Waits to see whether all edges found room.
    ///
    /// # Errors
    /// A network that is too large for the kernels, too little memory, no compiler, or a kernel
    /// failed.
    pub fn make(&mut self, host: &HostWindows) -> Result<&DeviceBatch, CudaError> {
        let mut room = match self.room.take() {
            Some(room) if self.windows == host.points => room,
            _ => self.room(&host.points, EDGES_PER_POINT * host.points.iter().sum::<usize>())?,
        };
        let stream = self.device.stream().clone();
        loop {
            stream.memcpy_htod(&host.positions, &mut room.positions)?;
            stream.memcpy_htod(&host.targets, &mut room.batch.targets)?;
            let Room { builder, positions, batch } = &mut room;
            builder.set_statics(&host.statics)?;
            builder.set_obstacles(&host.obstacles)?;
            let values = host.targets.len();
            let at: Vec<_> = (0..self.config.window())
                .map(|k| positions.slice(k * values..(k + 1) * values))
                .collect();
            let first = at.len() - batch.frames.len();
            for (k, frame) in (first..).zip(&mut batch.frames) {
                builder.graph(&at[k], frame)?;
                let known = match self.config.kind {
                    ModelKind::Tgnns => (k + 1 - first).min(2),
                    ModelKind::Gns => self.config.frames,
                };
                builder.features(&at[..=k], known, frame)?;
            }
            let needed = builder.needed()?;
            if needed <= batch.frames[0].graph.capacity {
                break;
            }
            room = self.room(&host.points, needed + needed / 4)?;
        }
        self.windows.clone_from(&host.points);
        Ok(&self.room.insert(room).batch)
    }

    fn room(&self, windows: &[usize], capacity: usize) -> Result<Room, CudaError> {
        let Self { device, config, norm, bounds, .. } = self;
        let builder = FrameBuilder::new(device, config, norm, bounds, windows)?;
        let values = builder.points() * config.dimensions;
        let frames = (0..config.graphs()).map(|_| builder.allocate(capacity));
        Ok(Room {
            positions: device.zeros(config.window() * values)?,
            batch: DeviceBatch {
                frames: frames.collect::<Result<_, _>>()?,
                targets: device.zeros(values)?,
            },
            builder,
        })
    }
}
