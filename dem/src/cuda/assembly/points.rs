//! Points in device memory.

use std::sync::Arc;

use cudarc::driver::{CudaSlice, PinnedHostSlice};
use gpu::Device;

use super::abi::{Extent, PointMean};
use super::energy::{ENERGIES, SUM_THREADS};
use crate::assembly::Members;
use crate::cuda::real::CudaReal;

/// Points and the means over their grains.
#[derive(Debug)]
pub(super) struct DevicePoints<R: CudaReal> {
    /// Where the grains of each point begin, and the grains point by point.
    pub start: CudaSlice<u32>,
    pub member: CudaSlice<u32>,
    pub mean: CudaSlice<PointMean>,
    /// Sums over blocks of grains (J).
    pub energy: CudaSlice<f64>,
    /// Of grains.
    pub extent: CudaSlice<Extent<R>>,
    /// All three on the host, of the last fetch.
    pub fetched: PinnedHostSlice<PointMean>,
    pub fetched_energy: PinnedHostSlice<f64>,
    pub fetched_extents: PinnedHostSlice<Extent<R>>,
}

impl<R: CudaReal> DevicePoints<R> {
    pub fn new(device: &Arc<Device>, members: &Members, grains: usize) -> Result<Self, gpu::Error> {
        let (start, member) = members.rows();
        let points = members.points();
        let sums = ENERGIES * grains.div_ceil(SUM_THREADS as usize);
        let indices = size_of_val(start) + size_of_val(member);
        let means = points * size_of::<PointMean>();
        let extents = grains * size_of::<Extent<R>>();
        device.reserve(indices + means + extents + sums * size_of::<f64>())?;
        Ok(Self {
            start: device.upload(start)?,
            member: device.upload(member)?,
            mean: device.zeros(points)?,
            energy: device.zeros(sums)?,
            extent: device.zeros(grains)?,
            fetched: device.pinned(points)?,
            fetched_energy: device.pinned(sums)?,
            fetched_extents: device.pinned(grains)?,
        })
    }
}
