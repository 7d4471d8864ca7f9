//! Points in device memory.

use std::sync::Arc;

use cudarc::driver::{CudaSlice, PinnedHostSlice};
use gpu::Device;

use super::abi::PointMean;
use super::energy::ENERGIES;
use super::losses::SUM_THREADS;
use crate::assembly::Members;

/// Points and the means over their grains.
#[derive(Debug)]
pub(super) struct DevicePoints {
    /// Where the grains of each point begin, and the grains point by point.
    pub start: CudaSlice<u32>,
    pub member: CudaSlice<u32>,
    pub mean: CudaSlice<PointMean>,
    /// Sums over blocks of grains (J).
    pub energy: CudaSlice<f64>,
    /// Both on the host, of the last fetch.
    pub fetched: PinnedHostSlice<PointMean>,
    pub fetched_energy: PinnedHostSlice<f64>,
}

impl DevicePoints {
    pub fn new(device: &Arc<Device>, members: &Members, grains: usize) -> Result<Self, gpu::Error> {
        let (start, member) = members.rows();
        let points = members.points();
        let sums = ENERGIES * grains.div_ceil(SUM_THREADS as usize);
        let indices = size_of_val(start) + size_of_val(member);
        let means = points * size_of::<PointMean>();
        device.reserve(indices + means + sums * size_of::<f64>())?;
        Ok(Self {
            start: device.upload(start)?,
            member: device.upload(member)?,
            mean: device.zeros(points)?,
            energy: device.zeros(sums)?,
            fetched: device.pinned(points)?,
            fetched_energy: device.pinned(sums)?,
        })
    }
}
