//! The kernels of a network, compiled while its first frames are read or simulated.

use gpu::Device;

use super::error::CudaError;
use super::ops::features::features_source;
use super::ops::graph::graph_source;
use super::ops::integrate::integrate_source;
use super::ops::kernels::network_sources;
use super::ops::push_forward::push_forward_source;
use crate::network::Precision;

/// Starts to compile all kernels of a network in one precision side by side, and returns at once.
///
/// # Errors
/// The driver refuses to tell the limits of the GPU.
pub fn compile_ahead(device: &Device, precision: Precision) -> Result<(), CudaError> {
    let others = [graph_source(), features_source(), integrate_source(), push_forward_source()];
    let shared = device.limits()?.shared_per_block;
    device.compile_ahead(network_sources(precision, shared).into_iter().chain(others));
    Ok(())
}
