//! Precisions that the kernels are compiled for.

use cudarc::driver::{DeviceRepr, ValidAsZeroBits};

use crate::real::Real;

/// `f32` or `f64`, on the CPU and on the GPU.
pub trait CudaReal:
    Real<Fraction: DeviceRepr + ValidAsZeroBits> + DeviceRepr + ValidAsZeroBits
{
    /// `REAL_BITS` of the kernels.
    const BITS: usize;
}

impl CudaReal for f32 {
    const BITS: usize = 32;
}

impl CudaReal for f64 {
    const BITS: usize = 64;
}
