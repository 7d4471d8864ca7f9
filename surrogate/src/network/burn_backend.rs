//! Where networks are computed: the one place that names a backend.

use burn::backend::{Autodiff, Flex};
use burn::tensor::backend::BackendTypes;

/// The processor, in single precision.
pub type Cpu = Flex;
/// The same with gradients.
pub type CpuAutodiff = Autodiff<Cpu>;
/// A place of computation.
pub type Device = <Cpu as BackendTypes>::Device;

/// The device of both.
pub fn device() -> Device {
    Device::default()
}
