//! What kernels are told: the twins of structs in the CUDA sources.

use cudarc::driver::DeviceRepr;

/// Address in device memory; 0 is none.
pub type Address = u64;

/// `Pack` of weights.cu.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Pack {
    pub from: i32,
    pub stride: i32,
    pub rows: i32,
    pub columns: i32,
    pub transposed: i32,
    pub steps: i32,
    pub features: i32,
    pub parts: i32,
    pub plain: i32,
    pub to: i32,
}

/// `Forward` of forward.cu.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Forward {
    pub count: Address,
    pub x: [Address; 2],
    pub index: Address,
    pub features: Address,
    pub added: [Address; 2],
    pub added_index: [Address; 2],
    pub weights: Address,
    pub parameters: Address,
    pub hidden: Address,
    pub stride: u64,
    pub normal: Address,
    pub deviation: Address,
    pub output: Address,
    pub residual: Address,
    pub output32: Address,
    pub narrow: Address,
    pub sums: Address,
    pub units: i32,
    pub feature_count: i32,
    pub feature_stride: i32,
    pub feature_steps: i32,
    pub bias: i32,
    pub bias_stride: i32,
    pub last_bias: i32,
    pub norm: i32,
    pub input_norm: i32,
    pub layers: i32,
    pub width: i32,
    pub columns: i32,
    pub accumulate: i32,
    pub slope: f32,
}

/// `Backward` of backward.cuh.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Backward {
    pub count: Address,
    pub output: Address,
    pub output_index: Address,
    pub output32: Address,
    pub parts: [Address; 2],
    pub part_weights: Address,
    pub gathered: Address,
    pub gathered_index: Address,
    pub selection: Address,
    pub hidden: Address,
    pub stride: u64,
    pub normal: Address,
    pub deviation: Address,
    pub weights: Address,
    pub parameters: Address,
    pub products: Address,
    pub linear: Address,
    pub input32: [Address; 2],
    pub input: Address,
    pub norm_sums: Address,
    pub sums: Address,
    pub units: i32,
    pub select_none: i32,
    pub norm: i32,
    pub layers: i32,
    pub width: i32,
    pub accumulate: i32,
    pub product_count: i32,
    pub blocks: i32,
    pub slope: f32,
}

/// `Receive` of segment.cu.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Receive {
    pub nodes: Address,
    pub start: Address,
    pub sums: Address,
    pub parameters: Address,
    pub received: Address,
    pub norm: i32,
    pub width: i32,
}

/// `Product` of product.cuh.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Product {
    pub count: Address,
    pub x: Address,
    pub index: Address,
    pub features: Address,
    pub dz: Address,
    pub weight: Address,
    pub bias: Address,
    pub feature_count: i32,
    pub blocks: i32,
}

/// `Target` of optimiser.cu.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Target {
    pub sums: Address,
    pub shift_sums: Address,
    pub count: i32,
    pub size: i32,
    pub first: i32,
    pub rows: i32,
    pub columns: i32,
    pub shift_count: i32,
    pub norm: i32,
    pub width: i32,
    pub to: i32,
}

// SAFETY: plain numbers, laid out as in the sources.
unsafe impl DeviceRepr for Pack {}
// SAFETY: as above.
unsafe impl DeviceRepr for Product {}
// SAFETY: as above.
unsafe impl DeviceRepr for Target {}
