//! What frames are made of, on its way to the CPU.

use std::sync::Arc;

use cudarc::driver::{CudaSlice, CudaStream, PinnedHostSlice};
use gpu::{Device, Error};

use super::memory::Memory;

/// Host memory that the GPU writes to by itself, while the host does something else.
pub(super) struct FrameCopy {
    pub clock: PinnedHostSlice<u64>,
    pub position: PinnedHostSlice<f64>,
    pub velocity: PinnedHostSlice<f64>,
    pub affine_velocity: PinnedHostSlice<f64>,
    pub velocity_gradient: PinnedHostSlice<f64>,
    pub stress: PinnedHostSlice<f64>,
    pub volume: PinnedHostSlice<f64>,
    pub ledger: PinnedHostSlice<f64>,
}

impl FrameCopy {
    pub fn new(device: &Device, memory: &Memory) -> Result<Self, Error> {
        let like = |array: &CudaSlice<f64>| device.pinned(array.len());
        Ok(Self {
            clock: device.pinned(memory.clock.len())?,
            position: like(&memory.position)?,
            velocity: like(&memory.velocity)?,
            affine_velocity: like(&memory.affine_velocity)?,
            velocity_gradient: like(&memory.velocity_gradient)?,
            stress: like(&memory.stress)?,
            volume: like(&memory.volume)?,
            ledger: like(&memory.ledger)?,
        })
    }

    /// Queues the copies, which are there once the stream has come to this point.
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
