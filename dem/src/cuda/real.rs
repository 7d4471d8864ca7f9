//! Precisions of the kernel.

use gpu::{CudaName, CudaType};

use crate::real::Real;

/// `f32` or `f64`, on the CPU and on the GPU.
pub trait CudaReal: Real<Fraction: CudaType> + CudaType + CudaName {
    /// `REAL_BITS` of the kernel.
    const BITS: usize;
}

impl CudaReal for f32 {
    const BITS: usize = 32;
}

impl CudaReal for f64 {
    const BITS: usize = 64;
}
