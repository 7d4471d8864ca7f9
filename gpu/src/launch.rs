//! Kernels that take their places early.

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

impl Device {
    /// Queues a kernel that may take its place on the GPU while the one before it still runs (CUDA's
    /// programmatic dependent launch), so that a row of small kernels does not wait for each to start.
    /// May be captured in a graph. GPUs older than sm_90 start one kernel after the other.
    ///
    /// # Errors
    /// The launch was refused.
    ///
    /// # Safety
    /// `arguments` are those of the kernel, and memory that they refer to lives until it has run.
    /// The kernel calls `await_turn` (`await_turn.cuh`) before it reads or writes global memory.
    pub unsafe fn launch_early(
        &self,
        stream: &CudaStream,
        kernel: &CudaFunction,
        config: LaunchConfig,
        arguments: &[Argument<'_>],
    ) -> Result<(), Error> {
        let mut early = sys::CUlaunchAttribute {
            id: sys::CUlaunchAttributeID::CU_LAUNCH_ATTRIBUTE_PROGRAMMATIC_STREAM_SERIALIZATION,
            pad: [0; 4],
            value: sys::CUlaunchAttributeValue { programmaticStreamSerializationAllowed: 1 },
        };
        let config = sys::CUlaunchConfig {
            gridDimX: config.grid_dim.0,
            gridDimY: config.grid_dim.1,
            gridDimZ: config.grid_dim.2,
            blockDimX: config.block_dim.0,
            blockDimY: config.block_dim.1,
            blockDimZ: config.block_dim.2,
            sharedMemBytes: config.shared_mem_bytes,
            hStream: stream.cu_stream(),
            attrs: &raw mut early,
            numAttrs: u32::from(self.overlaps_kernels()),
        };
        let mut arguments: Vec<_> = arguments.iter().map(|argument| argument.0).collect();
        self.context().bind_to_thread()?;
        // SAFETY: the caller's arguments; they and the attribute are read before this returns.
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
