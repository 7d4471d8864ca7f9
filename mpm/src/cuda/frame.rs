//! Copies of points and contacts for a frame, on their way to the CPU.

use std::sync::Arc;

use cudarc::driver::{CudaStream, PinnedHostSlice};
use gpu::{Device, Error};

use super::abi::{Clock, Matrix, Vector};
use super::memory::Memory;

/// Page-locked memory to which the GPU copies while the host does something else.
pub(super) struct FrameCopy {
    pub clock: PinnedHostSlice<Clock>,
    pub position: PinnedHostSlice<Vector>,
    pub velocity: PinnedHostSlice<Vector>,
    pub affine_velocity: PinnedHostSlice<Matrix>,
    pub velocity_gradient: PinnedHostSlice<Matrix>,
    pub stress: PinnedHostSlice<Matrix>,
    pub volume: PinnedHostSlice<f64>,
    pub ledger: PinnedHostSlice<f64>,
}

impl FrameCopy {
    pub fn new(device: &Device, memory: &Memory) -> Result<Self, Error> {
        Ok(Self {
            clock: device.pinned(memory.clock.len())?,
            position: device.pinned(memory.position.len())?,
            velocity: device.pinned(memory.velocity.len())?,
            affine_velocity: device.pinned(memory.affine_velocity.len())?,
            velocity_gradient: device.pinned(memory.velocity_gradient.len())?,
            stress: device.pinned(memory.stress.len())?,
            volume: device.pinned(memory.volume.len())?,
            ledger: device.pinned(memory.ledger.len())?,
        })
    }

    /// Queues the copies.
    pub fn queue(&mut self, stream: &Arc<CudaStream>, memory: &Memory) -> Result<(), Error> {
        stream.memcpy_dtoh(&memory.clock, &mut self.clock)?;
        stream.memcpy_dtoh(&memory.position, &mut self.position)?;
        stream.memcpy_dtoh(&memory.velocity, &mut self.velocity)?;
        stream.memcpy_dtoh(&memory.affine_velocity, &mut self.affine_velocity)?;
        stream.memcpy_dtoh(&memory.velocity_gradient, &mut self.velocity_gradient)?;
        stream.memcpy_dtoh(&memory.stress, &mut self.stress)?;
        stream.memcpy_dtoh(&memory.volume, &mut self.volume)?;
        stream.memcpy_dtoh(&memory.ledger, &mut self.ledger)?;
        Ok(())
    }
}
