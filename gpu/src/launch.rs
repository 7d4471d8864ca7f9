//! Kernels with typed arguments, and their launch.
//!
//! [`kernel!`](crate::kernel) defines the arguments of a kernel as a struct; CUDA C++ compares them with
//! its parameters. [`Function`] is the kernel once it is compiled and loaded.

use std::ffi::c_void;
use std::marker::PhantomData;
use std::sync::Arc;

use cudarc::driver::sys::{
    CUfunction_attribute, CUlaunchAttribute, CUlaunchAttributeID, CUlaunchAttributeValue,
    CUlaunchConfig, cuLaunchKernelEx,
};
use cudarc::driver::{CudaFunction, CudaModule, CudaStream};

use crate::device::Device;
use crate::error::Error;

/// The arguments of a kernel. Implemented by [`kernel!`](crate::kernel).
///
/// # Safety
/// `addresses` are those of the values that the parameters of the kernel get, one each, all within
/// `self`.
pub unsafe trait Kernel: Copy {
    /// Name of the kernel in CUDA C++.
    const NAME: &'static str;

    /// Check of the types of the parameters, which follows the kernel in its source.
    fn check() -> String;

    /// Where the arguments lie.
    fn addresses(&self) -> Vec<*mut c_void>;
}

/// Defines the arguments of kernels, by the names that the parameters have. After the colon stands
/// the name of the kernel. There may be one generic parameter with a bound.
///
/// ```
/// use gpu::{Pointer, kernel, checks};
///
/// kernel! {
///     /// Multiplies numbers by one.
///     pub struct Scale: scale {
///         /// How many there are.
///         pub count: u32,
///         pub numbers: Pointer<f32>,
///         pub factor: f32,
///     }
/// }
///
/// let source = [
///     "extern \"C\" __global__ void scale(unsigned count, float* numbers, float factor) {}",
///     &checks![Scale],
/// ].concat();
/// assert!(source.contains("decltype(scale), void(unsigned , float *, float )"));
/// ```
#[macro_export]
macro_rules! kernel {
    ($(
        $(#[$doc:meta])*
        $vis:vis struct $name:ident $(<$real:ident: $bound:path>)?: $kernel:ident {
            $($(#[$field_doc:meta])* $field_vis:vis $field:ident: $type:ty),* $(,)?
        }
    )*) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        $vis struct $name $(<$real: $bound>)? {
            $($(#[$field_doc])* $field_vis $field: $type),*
        }

        // SAFETY: the addresses of all fields; CUDA C++ checks their types.
        unsafe impl $(<$real: $bound>)? $crate::Kernel for $name $(<$real>)? {
            const NAME: &'static str = stringify!($kernel);

            fn check() -> String {
                $crate::check_parameters(
                    stringify!($kernel),
                    &[$(<$type as $crate::CudaType>::declare("")),*],
                )
            }

            fn addresses(&self) -> ::std::vec::Vec<*mut ::std::ffi::c_void> {
                ::std::vec![$((&raw const self.$field).cast_mut().cast()),*]
            }
        }
    )*};
}

/// Checks of the parameters of kernels against their [`Kernel`]s: the end of a source.
#[macro_export]
macro_rules! checks {
    ($($kernel:ty),* $(,)?) => {
        [$crate::CHECK_PARAMETERS.to_owned() $(, <$kernel as $crate::Kernel>::check())*].concat()
    };
}

/// Templates for [`check_parameters`].
#[doc(hidden)]
pub const CHECK_PARAMETERS: &str = "\
#line 1 \"gpu/src/launch.rs\"
template <typename A, typename B> constexpr bool is_same_type = false;
template <typename A> constexpr bool is_same_type<A, A> = true;
";

/// For [`kernel!`](crate::kernel).
#[doc(hidden)]
pub fn check_parameters(kernel: &str, types: &[String]) -> String {
    let types = types.join(", ");
    format!(
        "static_assert(is_same_type<decltype({kernel}), void({types})>, \
         \"{kernel} has other parameters in Rust\");\n"
    )
}

/// How a kernel is launched: in blocks of one dimension, in a grid of one or two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Launch {
    /// Blocks along x and y.
    pub grid: [u32; 2],
    /// Threads of a block.
    pub threads: u32,
    /// Dynamic shared memory of a block (bytes).
    pub shared: u32,
    /// Programmatic dependent launch (PDL): its blocks may start while the kernel before it still runs, so
    /// that launch latencies of small kernels overlap. Ignored before sm_90.
    pub early: bool,
    /// Highest priority: its blocks start before waiting blocks of other kernels. For small kernels beside
    /// large ones of other streams.
    pub urgent: bool,
}

impl Launch {
    /// `blocks` blocks of `threads` threads.
    pub fn blocks(blocks: u32, threads: u32) -> Self {
        Self { grid: [blocks, 1], threads, shared: 0, early: false, urgent: false }
    }

    /// `count` threads or a few more, in blocks of `threads`; at least one block.
    pub fn each(count: usize, threads: u32) -> Self {
        Self::blocks(count.div_ceil(threads as usize).max(1) as u32, threads)
    }

    /// A grid of `rows` rows of these blocks; `blockIdx.y` is the row.
    #[must_use]
    pub fn rows(self, rows: u32) -> Self {
        Self { grid: [self.grid[0], rows], ..self }
    }

    /// With this much dynamic shared memory for each block (bytes).
    #[must_use]
    pub fn shared(self, bytes: usize) -> Self {
        Self { shared: bytes as u32, ..self }
    }

    /// As [`early`](Self#structfield.early).
    #[must_use]
    pub fn early(self, early: bool) -> Self {
        Self { early, ..self }
    }

    /// As [`urgent`](Self#structfield.urgent).
    #[must_use]
    pub fn urgent(self) -> Self {
        Self { urgent: true, ..self }
    }
}

/// A kernel that is loaded.
#[derive(Debug)]
pub struct Function<K> {
    device: Arc<Device>,
    function: CudaFunction,
    arguments: PhantomData<fn(K)>,
}

impl<K: Kernel> Function<K> {
    /// Finds the kernel in a module, whose source has to [check](crate::checks) its parameters.
    ///
    /// # Errors
    /// The module has no such kernel.
    pub fn load(device: &Arc<Device>, module: &Arc<CudaModule>) -> Result<Self, Error> {
        let function = module.load_function(K::NAME)?;
        Ok(Self { device: device.clone(), function, arguments: PhantomData })
    }

    /// Allows blocks this much dynamic shared memory (bytes); without, it is 48 KiB.
    ///
    /// # Errors
    /// The GPU has less.
    pub fn with_shared(self, bytes: usize) -> Result<Self, Error> {
        self.function.set_attribute(
            CUfunction_attribute::CU_FUNC_ATTRIBUTE_MAX_DYNAMIC_SHARED_SIZE_BYTES,
            bytes as i32,
        )?;
        Ok(self)
    }

    /// The driver's handle, for registers and occupancy.
    pub fn function(&self) -> &CudaFunction {
        &self.function
    }

    /// Queues the kernel. May be captured in a graph.
    ///
    /// # Errors
    /// The launch was refused.
    ///
    /// # Safety
    /// The kernel may work with these arguments and this launch: arrays that they point to are as long
    /// as it expects and live until it has run. An early kernel calls `await_turn`
    /// (`await_turn.cuh`) before it reads or writes global memory that the one before it works on.
    pub unsafe fn launch(
        &self,
        stream: &CudaStream,
        launch: Launch,
        arguments: &K,
    ) -> Result<(), Error> {
        use CUlaunchAttributeID as Id;
        let attribute = |id, value| CUlaunchAttribute { id, pad: [0; 4], value };
        let mut attributes = Vec::new();
        if launch.early && self.device.overlaps_kernels() {
            let value = CUlaunchAttributeValue { programmaticStreamSerializationAllowed: 1 };
            attributes
                .push(attribute(Id::CU_LAUNCH_ATTRIBUTE_PROGRAMMATIC_STREAM_SERIALIZATION, value));
        }
        if launch.urgent {
            let value = CUlaunchAttributeValue { priority: self.device.urgent_priority() };
            attributes.push(attribute(Id::CU_LAUNCH_ATTRIBUTE_PRIORITY, value));
        }
        let config = CUlaunchConfig {
            gridDimX: launch.grid[0],
            gridDimY: launch.grid[1],
            gridDimZ: 1,
            blockDimX: launch.threads,
            blockDimY: 1,
            blockDimZ: 1,
            sharedMemBytes: launch.shared,
            hStream: stream.cu_stream(),
            attrs: attributes.as_mut_ptr(),
            numAttrs: attributes.len() as u32,
        };
        let mut addresses = arguments.addresses();
        self.device.context().bind_to_thread()?;
        // SAFETY: the caller's arguments; they and the attributes are read before this returns.
        unsafe {
            cuLaunchKernelEx(
                &raw const config,
                self.function.cu_function(),
                addresses.as_mut_ptr(),
                std::ptr::null_mut(),
            )
        }
        .result()?;
        Ok(())
    }
}
