//! Training batches made on the device: examples -> noisy windows, targets -> graphs, features.

use std::sync::Arc;

use cudarc::driver::{CudaFunction, CudaSlice, PushKernelArg};
use gpu::Device;

use super::buffers::FrameInput;
use super::error::CudaError;
use super::features::{FrameBuilder, features_defines};
use super::launch::each;
use super::noise::{Augmentation, HostBatch, Member, MemberRecord, NOISE_SOURCE, Walk};
use crate::config::ModelConfig;
use crate::features::Normalisation;

/// Room for edges of each point at first; it grows as needed.
const EDGES_PER_POINT: usize = 48;

/// Makes batches for a TGNNS, one in the place of the other.
pub struct BatchBuilder {
    device: Arc<Device>,
    kernel: CudaFunction,
    config: ModelConfig,
    norm: Normalisation,
    bounds: Vec<[f64; 2]>,
    augmentation: Augmentation,
    /// Points of each window of the batch.
    windows: Vec<usize>,
    room: Option<Room>,
}

/// A batch and what it is made with.
struct Room {
    builder: FrameBuilder,
    window: CudaSlice<u32>,
    members: CudaSlice<MemberRecord>,
    truth: CudaSlice<f64>,
    positions: CudaSlice<f32>,
    batch: DeviceBatch,
}

/// What a network learns from in one step.
pub struct DeviceBatch {
    /// The frames of the windows, oldest first.
    pub frames: Vec<FrameInput>,
    /// Normalised accelerations, points x dimensions.
    pub targets: CudaSlice<f32>,
}

impl BatchBuilder {
    /// `bounds` are the lower and upper wall of each direction (m).
    ///
    /// # Errors
    /// No compiler.
    pub fn new(
        device: &Arc<Device>,
        config: &ModelConfig,
        norm: &Normalisation,
        bounds: &[[f64; 2]],
        augmentation: Augmentation,
    ) -> Result<Self, CudaError> {
        let defines = features_defines(config.dimensions);
        let module = device.module("noise.cu", NOISE_SOURCE, &defines)?;
        Ok(Self {
            device: device.clone(),
            kernel: module.load_function("make_windows")?,
            config: config.clone(),
            norm: norm.clone(),
            bounds: bounds.to_vec(),
            augmentation,
            windows: Vec::new(),
            room: None,
        })
    }

    /// Makes the batch of some examples, at least one, all with the frames of the network. Waits
    /// only to see whether all edges found room.
    ///
    /// # Errors
    /// Too little memory, or a kernel failed.
    pub fn make(&mut self, members: &[Member]) -> Result<&DeviceBatch, CudaError> {
        let frames = self.config.frames;
        let host = HostBatch::new(members, frames, self.augmentation.without_gravity);
        let windows: Vec<usize> = members.iter().map(|member| member.example.points).collect();
        let mut room = match self.room.take() {
            Some(room) if self.windows == windows => room,
            _ => self.room(&windows, EDGES_PER_POINT * windows.iter().sum::<usize>())?,
        };
        let stream = self.device.stream().clone();
        let walk = Walk::new(&self.augmentation, &self.norm, &host);
        loop {
            stream.memcpy_htod(&host.members, &mut room.members)?;
            stream.memcpy_htod(&host.truth, &mut room.truth)?;
            // SAFETY: the argument types are those of the kernel, the arrays as long as it expects.
            unsafe {
                let mut launch = stream.launch_builder(&self.kernel);
                launch.arg(&walk).arg(&room.members).arg(&room.window).arg(&room.truth);
                launch.arg(&room.positions).arg(&room.batch.targets);
                launch.launch(each(host.values))?;
            }
            let Room { builder, positions, batch, .. } = &mut room;
            let at = |k: usize| positions.slice(k * host.values..(k + 1) * host.values);
            for (k, frame) in batch.frames.iter_mut().enumerate() {
                builder.graph(&at(k), frame)?;
                let before = (k > 0).then(|| at(k - 1));
                builder.features(&at(k), before.as_ref(), frame)?;
            }
            let needed = builder.needed()?;
            if needed <= batch.frames[0].graph.capacity {
                break;
            }
            room = self.room(&windows, needed + needed / 4)?;
        }
        self.windows = windows;
        Ok(&self.room.insert(room).batch)
    }

    fn room(&self, windows: &[usize], capacity: usize) -> Result<Room, CudaError> {
        let Self { device, config, norm, bounds, .. } = self;
        let builder = FrameBuilder::new(device, config, norm, bounds, windows)?;
        let values = builder.points() * config.dimensions;
        let numbered = windows.iter().enumerate();
        let window: Vec<u32> =
            numbered.flat_map(|(k, &n)| std::iter::repeat_n(k as u32, n)).collect();
        let frames = (0..config.frames).map(|_| builder.allocate(capacity));
        Ok(Room {
            window: device.upload(&window)?,
            members: device.upload(&vec![MemberRecord::default(); windows.len()])?,
            truth: device.zeros((config.frames + 1) * values)?,
            positions: device.zeros(config.frames * values)?,
            batch: DeviceBatch {
                frames: frames.collect::<Result<_, _>>()?,
                targets: device.zeros(values)?,
            },
            builder,
        })
    }
}
