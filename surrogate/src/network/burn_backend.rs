//! The Burn backends of the networks.

use burn::backend::{Autodiff, Flex};
use burn::tensor::backend::BackendTypes;

/// The CPU, in single precision.
pub type Cpu = Flex;
/// The same with automatic differentiation.
pub type CpuAutodiff = Autodiff<Cpu>;
/// Device of both backends.
pub type Device = <Cpu as BackendTypes>::Device;

/// The CPU as the device of both backends.
pub fn device() -> Device {
    Device::default()
}

/// A GPU, in single precision.
#[cfg(feature = "burn-cuda")]
pub type Gpu = burn::backend::Cuda;
/// The same with automatic differentiation.
#[cfg(feature = "burn-cuda")]
pub type GpuAutodiff = Autodiff<Gpu>;
/// Device of both.
#[cfg(feature = "burn-cuda")]
pub type GpuDevice = <Gpu as BackendTypes>::Device;

/// A GPU as the device of Burn.
#[cfg(feature = "burn-cuda")]
pub fn gpu_device(device: &gpu::Device) -> GpuDevice {
    GpuDevice::new(device.context().ordinal())
}
