//! The Burn backend of the networks on the CPU.

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
