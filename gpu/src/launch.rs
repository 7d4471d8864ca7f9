//! Kernels that take their places early, or before others.

use std::ffi::c_void;
use std::marker::PhantomData;

use cudarc::driver::{CudaFunction, CudaStream, DeviceRepr, LaunchConfig, sys};

use crate::device::Device;
use crate::error::Error;

/// An argument of a kernel, by reference.
#[derive(Debug)]
pub struct Argument<'a>(*mut c_void, PhantomData<&'a ()>);

/// A number, a struct or an address as an argument of a kernel.
pub fn argument<T: DeviceRepr>(value: &T) -> Argument<'_> {
    Argument(std::ptr::from_ref(value).cast_mut().cast(), PhantomData)
}

/// How a kernel is launched.
#[derive(Clone, Copy, Debug)]
pub struct How {
    /// It may take its place on the GPU while the one kernel before it still runs (CUDA's programmatic
    /// dependent launch), so that a row of small kernels does not wait for each to start. GPUs older
    /// than sm_90 start one kernel after the other.
    pub early: bool,
    /// Its blocks go before those of kernels that are not urgent and wait for a place. For small
    /// kernels, beside large ones of other streams.
    pub urgent: bool,
}

impl Device {
    /// Queues a kernel. May be captured in a graph.
    ///
    /// # Errors
    /// The launch was refused.
    ///
    /// # Safety
    /// `arguments` are those of the kernel, and memory that they refer to lives until it has run. An
    /// early kernel calls `await_turn` (`await_turn.cuh`) before it reads or writes global memory.
    pub unsafe fn launch(
        &self,
        how: How,
        stream: &CudaStream,
        kernel: &CudaFunction,
        config: LaunchConfig,
        arguments: &[Argument<'_>],
    ) -> Result<(), Error> {
        use sys::CUlaunchAttributeID as Id;
        let attribute = |id, value| sys::CUlaunchAttribute { id, pad: [0; 4], value };
        let mut attributes = Vec::new();
        if how.early && self.overlaps_kernels() {
            let value = sys::CUlaunchAttributeValue { programmaticStreamSerializationAllowed: 1 };
            attributes
                .push(attribute(Id::CU_LAUNCH_ATTRIBUTE_PROGRAMMATIC_STREAM_SERIALIZATION, value));
        }
        if how.urgent {
            let value = sys::CUlaunchAttributeValue { priority: self.urgent_priority() };
            attributes.push(attribute(Id::CU_LAUNCH_ATTRIBUTE_PRIORITY, value));
        }
        let config = sys::CUlaunchConfig {
            gridDimX: config.grid_dim.0,
            gridDimY: config.grid_dim.1,
            gridDimZ: config.grid_dim.2,
            blockDimX: config.block_dim.0,
            blockDimY: config.block_dim.1,
            blockDimZ: config.block_dim.2,
            sharedMemBytes: config.shared_mem_bytes,
            hStream: stream.cu_stream(),
            attrs: attributes.as_mut_ptr(),
            numAttrs: attributes.len() as u32,
        };
        let mut arguments: Vec<_> = arguments.iter().map(|argument| argument.0).collect();
        self.context().bind_to_thread()?;
        // SAFETY: the caller's arguments; they and the attributes are read before this returns.
        unsafe {
            sys::cuLaunchKernelEx(
                &raw const config,
                kernel.cu_function(),
                arguments.as_mut_ptr(),
                std::ptr::null_mut(),
            )
        }
        .result()?;
        Ok(())
    }
}
