//! A GPU and its memory.

use std::sync::{Arc, OnceLock};

use cudarc::driver::result::stream::get_priority_range;
use cudarc::driver::sys::{self, CUdevice_attribute, CUresult};
use cudarc::driver::{
    CudaContext, CudaModule, CudaSlice, CudaStream, DeviceRepr, DriverError, PinnedHostSlice,
    ValidAsZeroBits,
};
use cudarc::nvrtc::Ptx;
use files::note;

use crate::ahead::Threads;
use crate::compiler::{compile_ahead, compile_cached, nvrtc_is_present, nvrtc_version};
use crate::error::Error;
use crate::source::Source;

/// Limits on thread blocks.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Shared memory that one block can have (bytes).
    pub shared_per_block: usize,
    /// Shared memory of a multiprocessor for all its blocks (bytes).
    pub shared_per_multiprocessor: usize,
}

impl Limits {
    /// An H100 or H200.
    pub const SM_90: Self =
        Self { shared_per_block: 227 << 10, shared_per_multiprocessor: 228 << 10 };
    /// An A100.
    pub const SM_80: Self =
        Self { shared_per_block: 163 << 10, shared_per_multiprocessor: 164 << 10 };
}

/// A GPU with a stream, on which its work is queued.
#[derive(Clone, Debug)]
pub struct Device {
    context: Arc<CudaContext>,
    stream: Arc<CudaStream>,
    name: String,
    architecture: String,
    driver: (i32, i32),
    overlaps_kernels: bool,
    urgent_priority: i32,
    ahead: Arc<Threads>,
}

impl Device {
    /// Number of GPUs; 0 without a driver.
    pub fn count() -> usize {
        // SAFETY: loads the library, whose initialisers have no preconditions, and unloads it.
        if !unsafe { sys::is_culib_present() } {
            return 0;
        }
        CudaContext::device_count().map_or(0, |count| usize::try_from(count).unwrap_or(0))
    }

    /// Opens GPU `ordinal`, counted from 0.
    ///
    /// # Errors
    /// No driver, no NVRTC, an NVRTC newer than the driver, no such GPU, or a GPU older than sm_80.
    pub fn new(ordinal: usize) -> Result<Arc<Self>, Error> {
        // SAFETY: loads the library, whose initialisers have no preconditions, and unloads it.
        if !unsafe { sys::is_culib_present() } {
            return Err(Error::NoDriver);
        }
        let mut version = 0;
        // SAFETY: writes the integer; allowed before initialisation.
        unsafe { sys::cuDriverGetVersion(&raw mut version) }
            .result()
            .map_err(|_| Error::NoDriver)?;
        let driver = (version / 1000, version % 1000 / 10);
        check_versions(driver, nvrtc_version()?)?;
        let count = Self::count();
        if 0 < count && count <= ordinal {
            return Err(Error::NoSuchDevice { ordinal, count });
        }
        let context = CudaContext::new(ordinal)?;
        // SAFETY: streams order all work; events between allocations could not be captured in a
        // graph.
        unsafe { context.disable_event_tracking() };
        let stream = context.new_stream()?;
        let (major, minor) = context.compute_capability()?;
        if major < 8 {
            return Err(Error::GpuTooOld { name: context.name()?, capability: (major, minor) });
        }
        Ok(Arc::new(Self {
            name: context.name()?,
            architecture: architecture(major, minor),
            driver,
            // From this driver on also in graphs.
            overlaps_kernels: major >= 9 && driver >= (12, 4),
            urgent_priority: get_priority_range()?.1,
            context,
            stream,
            ahead: Arc::default(),
        }))
    }

    /// The same GPU with a stream of its own, for another thread: a thread that captures a graph must
    /// not see work of others on its stream.
    ///
    /// # Errors
    /// A failure of the GPU.
    pub fn with_own_stream(&self) -> Result<Arc<Self>, Error> {
        Ok(Arc::new(Self { stream: self.context.new_stream()?, ..self.clone() }))
    }

    /// The same GPU with a stream of its own, of high priority: its blocks start before waiting blocks of
    /// other streams.
    ///
    /// # Errors
    /// A failure of the GPU.
    pub fn with_urgent_stream(&self) -> Result<Arc<Self>, Error> {
        let stream = self.context.new_stream_with_priority(self.urgent_priority)?;
        Ok(Arc::new(Self { stream, ..self.clone() }))
    }

    /// The vendor's name of the GPU.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Architecture to compile for, such as `sm_80`.
    pub fn architecture(&self) -> &str {
        &self.architecture
    }

    /// CUDA version (major, minor) that the driver supports.
    pub fn driver(&self) -> (i32, i32) {
        self.driver
    }

    /// The GPU's primary context.
    pub fn context(&self) -> &Arc<CudaContext> {
        &self.context
    }

    /// The stream on which work is queued.
    pub fn stream(&self) -> &Arc<CudaStream> {
        &self.stream
    }

    /// Whether the GPU has programmatic dependent launch (PDL).
    pub(crate) fn overlaps_kernels(&self) -> bool {
        self.overlaps_kernels
    }

    /// The highest priority of a stream or launch.
    pub(crate) fn urgent_priority(&self) -> i32 {
        self.urgent_priority
    }

    /// Limits on thread blocks.
    ///
    /// # Errors
    /// The driver refuses to tell.
    pub fn limits(&self) -> Result<Limits, Error> {
        let attribute = |a| -> Result<usize, DriverError> {
            Ok(usize::try_from(self.context.attribute(a)?).unwrap_or(0))
        };
        use CUdevice_attribute as A;
        Ok(Limits {
            shared_per_block: attribute(A::CU_DEVICE_ATTRIBUTE_MAX_SHARED_MEMORY_PER_BLOCK_OPTIN)?,
            shared_per_multiprocessor: attribute(
                A::CU_DEVICE_ATTRIBUTE_MAX_SHARED_MEMORY_PER_MULTIPROCESSOR,
            )?,
        })
    }

    /// Compiles a source for this GPU, or takes it from the cache, and loads it. `defines` are
    /// preprocessor definitions `NAME=value`.
    ///
    /// # Errors
    /// The source does not compile, or cannot be loaded.
    pub fn module(
        &self,
        name: &str,
        source: &str,
        defines: &[String],
    ) -> Result<Arc<CudaModule>, Error> {
        let cubin = compile_cached(name, source, &self.architecture, defines, self.driver)?;
        Ok(self.context.load_module(Ptx::from_binary(cubin))?)
    }

    /// Starts to compile sources for this GPU side by side, in threads, and returns at once. [`module`](Self::module)
    /// waits for the one that it loads. A source that does not compile, or is not loaded after all, does no harm; the
    /// last owner of the device waits for it.
    pub fn compile_ahead(&self, sources: impl IntoIterator<Item = Source>) {
        compile_ahead(&self.ahead, sources, &self.architecture, self.driver);
    }

    /// Checks that `needed` bytes are free.
    ///
    /// # Errors
    /// There are fewer.
    pub fn reserve(&self, needed: usize) -> Result<(), Error> {
        let (available, _) = self.context.mem_get_info()?;
        if needed > available {
            return Err(Error::OutOfMemory { needed, available });
        }
        Ok(())
    }

    /// Copies an array to new device memory.
    ///
    /// # Errors
    /// Too little memory.
    pub fn upload<T: DeviceRepr>(&self, host: &[T]) -> Result<CudaSlice<T>, Error> {
        self.stream.clone_htod(host).map_err(|e| self.memory_error(e, size_of_val(host)))
    }

    /// A new array of `len` entries in device memory, all zero.
    ///
    /// # Errors
    /// Too little memory.
    pub fn zeros<T: DeviceRepr + ValidAsZeroBits>(
        &self,
        len: usize,
    ) -> Result<CudaSlice<T>, Error> {
        self.stream.alloc_zeros(len).map_err(|e| self.memory_error(e, len * size_of::<T>()))
    }

    /// A new array of `len` entries in page-locked host memory, for copies beside the host's work. Not
    /// initialised. Reading does not wait for copies: synchronise their stream first.
    ///
    /// # Errors
    /// Too little memory.
    pub fn pinned<T: DeviceRepr + ValidAsZeroBits>(
        &self,
        len: usize,
    ) -> Result<PinnedHostSlice<T>, Error> {
        // SAFETY: any bits are numbers. No flags: memory without caches would be slow to read.
        Ok(unsafe { self.context.alloc_pinned_with_flags(len, 0) }?)
    }

    fn memory_error(&self, error: DriverError, needed: usize) -> Error {
        if error.0 != CUresult::CUDA_ERROR_OUT_OF_MEMORY {
            return error.into();
        }
        let available = self.context.mem_get_info().map_or(0, |(free, _)| free);
        Error::OutOfMemory { needed, available }
    }
}

/// A driver runs code from an NVRTC of its own major version or an older one.
fn check_versions(driver: (i32, i32), nvrtc: (i32, i32)) -> Result<(), Error> {
    if driver.0 < nvrtc.0 { Err(Error::DriverTooOld { driver, nvrtc }) } else { Ok(()) }
}

/// Name of the architecture. `wgmma` needs the target `sm_90a`.
fn architecture(major: i32, minor: i32) -> String {
    format!("sm_{major}{minor}{}", if (major, minor) == (9, 0) { "a" } else { "" })
}

/// The first GPU with a stream of its own, for tests. Without one, prints why and returns `None`.
///
/// # Panics
/// There is no usable GPU and the environment has `DEMPM_REQUIRE_GPU=1`.
pub fn for_tests() -> Option<Arc<Device>> {
    static DEVICE: OnceLock<Option<Arc<Device>>> = OnceLock::new();
    let device = DEVICE.get_or_init(|| match Device::new(0) {
        Ok(device) => Some(device),
        Err(error) if std::env::var("DEMPM_REQUIRE_GPU").is_ok_and(|v| v == "1") => {
            panic!("DEMPM_REQUIRE_GPU=1, but {error}")
        }
        Err(error) => {
            note!("skipped: {error}");
            None
        }
    });
    device.as_ref().map(|device| device.with_own_stream().expect("a stream"))
}

/// Whether NVRTC is present, for tests that compile kernels without a GPU. Prints if it is not.
///
/// # Panics
/// NVRTC is missing and the environment has `DEMPM_REQUIRE_NVRTC`.
pub fn nvrtc_for_tests() -> bool {
    let present = nvrtc_is_present();
    if !present {
        let required = std::env::var_os("DEMPM_REQUIRE_NVRTC").is_some();
        assert!(!required, "NVRTC was not found, but DEMPM_REQUIRE_NVRTC is set");
        note!("skipped: {}", Error::NvrtcMissing);
    }
    present
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_driver_older_than_the_compiler_is_refused_with_a_remedy() {
        assert!(check_versions((13, 0), (12, 8)).is_ok());
        assert!(check_versions((12, 2), (12, 8)).is_ok());
        let text = check_versions((11, 8), (12, 4)).unwrap_err().to_string();
        assert!(text.contains("CUDA 11.8") && text.contains("12.4") && text.contains("update"));
    }

    /// Without a GPU too: kernels compiled side by side are those compiled alone, and one that fails tells why.
    #[test]
    fn kernels_compile_side_by_side() {
        if !nvrtc_for_tests() {
            return;
        }
        // Kernels know the folder in which they were compiled: another one must not share the cache.
        let source = |k: usize| Source {
            name: "ahead.cu",
            text: format!(
                "// {}\nextern \"C\" __global__ void k(float* x) {{ x[0] = K; }}",
                env!("CARGO_MANIFEST_DIR")
            ),
            defines: vec![format!("K={k}")],
        };
        let wrong = Source { text: "not CUDA".to_owned(), ..source(0) };
        let driver = (12, 4);
        let threads = Threads::default();
        compile_ahead(&threads, (1..4).map(source).chain([wrong.clone()]), "sm_80", driver);
        let load = |Source { name, text, defines }: Source| {
            compile_cached(name, &text, "sm_80", &defines, driver)
        };
        for Source { name, text, defines } in (1..4).map(source) {
            let alone = crate::compile(name, &text, "sm_80", &defines).unwrap();
            assert_eq!(load(Source { name, text, defines }).unwrap(), alone);
        }
        assert!(load(wrong).unwrap_err().to_string().contains("ahead.cu"));
    }
}
