//! Precisions of the kernel.

use gpu::{CudaName, CudaType};

use crate::real::Real;

/// `f32` or `f64`, on the CPU and on the GPU.
pub trait CudaReal: Real<Fraction: CudaType + CudaName> + CudaType + CudaName {
    /// `REAL_BITS` of the kernel.
    const BITS: usize;

    /// The bits of a number.
    fn to_bits(self) -> Self::Fraction;
    /// The number of these bits.
    fn from_bits(bits: Self::Fraction) -> Self;
    /// 32 bits of flags in a word.
    fn info(flags: u32) -> Self::Fraction;
    /// The flags of a word.
    fn info_bits(word: Self::Fraction) -> u32;
}

impl CudaReal for f32 {
    const BITS: usize = 32;

    fn to_bits(self) -> u32 {
        self.to_bits()
    }
    fn from_bits(bits: u32) -> Self {
        Self::from_bits(bits)
    }
    fn info(flags: u32) -> u32 {
        flags
    }
    fn info_bits(word: u32) -> u32 {
        word
    }
}

impl CudaReal for f64 {
    const BITS: usize = 64;

    fn to_bits(self) -> u64 {
        self.to_bits()
    }
    fn from_bits(bits: u64) -> Self {
        Self::from_bits(bits)
    }
    fn info(flags: u32) -> u64 {
        flags.into()
    }
    fn info_bits(word: u64) -> u32 {
        word as u32
    }
}
